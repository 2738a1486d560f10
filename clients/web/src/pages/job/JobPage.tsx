import { Badge, Button, Group, Stack, Tabs } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link, useNavigate } from "@tanstack/react-router";
import { useState } from "react";
import { download } from "../../api/client";
import type { StreamState } from "../../api/events";
import type { JobSearch } from "../../api/jobs-search";
import { job as jobQuery, type JobDetail } from "../../api/queries";
import { ProblemNote } from "../../parts/Problem";
import { isSite } from "../../api/site";
import { Section } from "../../parts/Section";
import { Answered, Empty } from "../../parts/States";
import { BuildPart } from "./BuildPart";
import { JobFacts, JobHead } from "./JobFacts";
import { JobFiles } from "./JobFiles";
import { useLive } from "./live";
import { prompts as promptsQuery, replay as replayQuery, rolloutsOf, transcript as transcriptQuery } from "./queries";
import { TrialPart } from "./TrialPart";
import { useBuild } from "./build";
import { TranscriptView } from "./TranscriptView";

const route = getRouteApi("/jobs/$id");

/** How a machine came about, how its trial went, and what was made of it. */
export default function JobPage() {
  const { id } = route.useParams();
  const query = useQuery(jobQuery(id));
  const state = useLive(query.data, id);
  return (
    <Answered query={query} rows={12}>
      {(job) => (
        <Stack gap="lg">
          <JobHead job={job} />
          <Live state={state} />
          <JobFacts job={job} />
          <Room job={job} />
          <JobFiles job={job} />
        </Stack>
      )}
    </Answered>
  );
}

const LIVE: Readonly<Record<StreamState, readonly [string, string]>> = {
  live: ["teal", "● live: turns appear as they are taken"],
  connecting: ["gray", "○ connecting"],
  broken: ["yellow", "○ the service does not answer: connecting again"],
};

function Live({ state }: { state: StreamState | "ended" }) {
  if (state === "ended") return null;
  const [colour, text] = LIVE[state];
  return (
    <Badge
      color={colour}
      variant="outline"
      tt="none"
      role="status"
      data-live={state}
      styles={{ root: { color: "inherit" } }}
    >
      {text}
    </Badge>
  );
}

/** Transcript and machine, in step. */
function Room({ job }: { job: JobDetail }) {
  const search = route.useSearch();
  const navigate = useNavigate({ from: "/jobs/$id" });
  const transcript = useQuery(transcriptQuery(job.id));
  const prompts = useQuery(promptsQuery(job.id));
  const replay = useQuery(replayQuery(job.id));
  const build = useBuild(replay.data ?? null, transcript.data?.turns, search, (change) => {
    void navigate({ search: (before) => ({ ...before, ...change }), replace: true, resetScroll: false });
  });
  const trials = rolloutsOf(job.artifacts);
  const ended = job.state === "done";
  const [begun, setBegun] = useState(false);
  const change = (to: JobSearch): Promise<void> =>
    navigate({ search: (before) => ({ ...before, ...to }), replace: true, resetScroll: false });
  const show = (view: "trial" | undefined, playing: boolean): void => {
    setBegun(playing);
    void navigate({ search: (before) => ({ ...before, view }), replace: true, resetScroll: false });
  };
  return (
    <div className="job-room">
      <Section title="Machine" aside={job.artifacts.machine === undefined ? null : <GlbButton job={job} />}>
        <Tabs
          value={search.view ?? "built"}
          keepMounted={false}
          onChange={(value) => {
            show(value === "trial" ? "trial" : undefined, false);
          }}
        >
          <Tabs.List mb="sm">
            <Tabs.Tab value="built">How it was built</Tabs.Tab>
            <Tabs.Tab value="trial" disabled={trials.length === 0}>
              The trial
            </Tabs.Tab>
          </Tabs.List>
          <Tabs.Panel value="built">
            <Answered query={replay} rows={10}>
              {(found) =>
                found === null || build.steps.length === 0 ? (
                  <Empty title={ended ? "Nothing was built" : "Nothing is built yet"}>
                    {job.detail ??
                      (ended ? "No action reached a machine." : "The first action shows here as soon as it is taken.")}
                  </Empty>
                ) : (
                  <BuildPart
                    build={build}
                    onBuilt={
                      ended && trials.length > 0
                        ? () => {
                            show("trial", true);
                          }
                        : undefined
                    }
                  />
                )
              }
            </Answered>
          </Tabs.Panel>
          <Tabs.Panel value="trial">
            <TrialPart job={job} numbers={trials} begun={begun} seen={search} change={change} />
          </Tabs.Panel>
        </Tabs>
      </Section>
      <Section title="Transcript">
        <Answered query={transcript}>
          {(found) =>
            found === null || found.turns.length === 0 ? (
              <Empty title={ended ? "This job has no transcript" : "No turn was taken yet"} />
            ) : (
              <TranscriptView turns={found.turns} prompts={prompts.data} build={build} chosen={search.turn} />
            )
          }
        </Answered>
      </Section>
    </div>
  );
}

function GlbButton({ job }: { job: JobDetail }) {
  const [error, setError] = useState<unknown>(null);
  return (
    <Group gap="xs">
      {error !== null && <ProblemNote error={error} />}
      {!isSite && (
        <Link to="/build" search={{ task: job.task, remix: job.id }}>
          Remix it
        </Link>
      )}
      <Button
        size="compact-sm"
        variant="default"
        leftSection={<IconDownload size={14} aria-hidden />}
        onClick={() => {
          setError(null);
          download(`/v1/jobs/${encodeURIComponent(job.id)}/machine.glb`, `${job.id}.glb`).catch(setError);
        }}
      >
        GLB
      </Button>
    </Group>
  );
}
