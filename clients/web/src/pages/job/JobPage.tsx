import { Badge, Stack, Tabs } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, useNavigate } from "@tanstack/react-router";
import type { StreamState } from "../../api/events";
import type { JobSearch } from "../../api/jobs-search";
import { job as jobQuery, type JobDetail } from "../../api/queries";
import { Answered, Empty } from "../../parts/States";
import { BuildPart } from "./BuildPart";
import { JobHead, Measurements } from "./JobFacts";
import { JobFiles } from "./JobFiles";
import { useLive } from "./live";
import { prompts as promptsQuery, replay as replayQuery, rolloutsOf, transcript as transcriptQuery } from "./queries";
import { TrialPart } from "./TrialPart";
import { useBuild } from "./build";
import { TranscriptView } from "./TranscriptView";

const route = getRouteApi("/jobs/$id");

/** How a run ended, its machine, and how that came about. */
export default function JobPage() {
  const { id } = route.useParams();
  const query = useQuery(jobQuery(id));
  const state = useLive(query.data, id);
  return (
    <Answered query={query} rows={12}>
      {(job) => (
        <Stack gap="md">
          <JobHead job={job} />
          <Live state={state} />
          <Room job={job} />
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

/** The trial, or the machine as far as it is built; below it everything else, in tabs. */
function Room({ job }: { job: JobDetail }) {
  const search = route.useSearch();
  const navigate = useNavigate({ from: "/jobs/$id" });
  const transcript = useQuery(transcriptQuery(job.id));
  const prompts = useQuery(promptsQuery(job.id));
  const replay = useQuery(replayQuery(job.id));
  const change = (to: JobSearch): Promise<void> =>
    navigate({ search: (before) => ({ ...before, ...to }), replace: true, resetScroll: false });
  const trials = rolloutsOf(job);
  const tried = trials.length > 0;
  const build = useBuild(replay.data ?? null, transcript.data?.turns, search, (to) => {
    void change(tried ? { ...to, view: "building" } : to);
  });
  const ended = job.state === "done";
  const view = search.view ?? (tried && search.step !== undefined ? "building" : "transcript");
  const built = (
    <Answered query={replay} rows={10}>
      {(found) =>
        found === null || build.steps.length === 0 ? (
          <Empty title={ended ? "Nothing was built" : "Nothing is built yet"}>
            {job.detail ??
              (ended ? "No action reached a machine." : "The first action shows here as soon as it is taken.")}
          </Empty>
        ) : (
          <BuildPart build={build} />
        )
      }
    </Answered>
  );
  return (
    <>
      <section aria-label="Machine">
        {tried ? <TrialPart job={job} numbers={trials} seen={search} change={change} /> : built}
      </section>
      <Tabs
        value={view === "building" && !tried ? "transcript" : view}
        keepMounted={false}
        onChange={(to) => {
          void change({ view: (to ?? undefined) as JobSearch["view"], step: undefined });
        }}
      >
        <Tabs.List mb="sm">
          <Tabs.Tab value="transcript">Transcript</Tabs.Tab>
          {tried && <Tabs.Tab value="building">Building</Tabs.Tab>}
          <Tabs.Tab value="measurements">Measurements</Tabs.Tab>
          <Tabs.Tab value="files">Files</Tabs.Tab>
        </Tabs.List>
        <Tabs.Panel value="transcript">
          <Answered query={transcript}>
            {(found) =>
              found === null || found.turns.length === 0 ? (
                <Empty title={ended ? "This run has no transcript" : "No turn was taken yet"} />
              ) : (
                <TranscriptView turns={found.turns} prompts={prompts.data} build={build} chosen={search.turn} />
              )
            }
          </Answered>
        </Tabs.Panel>
        <Tabs.Panel value="building">{built}</Tabs.Panel>
        <Tabs.Panel value="measurements">
          <Measurements job={job} />
        </Tabs.Panel>
        <Tabs.Panel value="files">
          <JobFiles job={job} />
        </Tabs.Panel>
      </Tabs>
    </>
  );
}
