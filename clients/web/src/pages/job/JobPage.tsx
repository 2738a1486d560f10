import { SimpleGrid, Stack, Tabs } from "@mantine/core";
import { useQuery, useQueryClient } from "@tanstack/react-query";
import { getRouteApi, useNavigate } from "@tanstack/react-router";
import { lazy, Suspense, useCallback } from "react";
import { bytesOf } from "../../api/client";
import { useEvents } from "../../api/events";
import { artifact, job as jobQuery, task as taskQuery, type JobDetail } from "../../api/queries";
import { Section } from "../../parts/Section";
import { Answered, Empty, Loading } from "../../parts/States";
import type { MachineDocument } from "../../scene/machine";
import type { Scenario } from "../../scene/Surroundings";
import { JobFacts, JobHead } from "./JobFacts";
import { JobRecords } from "./JobRecords";
import type { Transcript } from "./transcript";
import { TranscriptView } from "./TranscriptView";

const MachineView = lazy(() => import("../../scene/MachineView"));
const TrialView = lazy(() => import("../../scene/TrialView"));
const route = getRouteApi("/jobs/$id");

/** How a machine came about, how its trial went, and what was made of it. */
export default function JobPage() {
  const { id } = route.useParams();
  const query = useQuery(jobQuery(id));
  const queries = useQueryClient();
  const open = query.data !== undefined && query.data.state !== "done";
  const onEvents = useCallback(() => void queries.invalidateQueries({ queryKey: jobQuery(id).queryKey }), [queries, id]);
  useEvents(open ? `/v1/jobs/${encodeURIComponent(id)}/events` : null, onEvents);
  return (
    <Answered query={query} rows={12}>
      {(job) => (
        <Stack gap="lg">
          <JobHead job={job} />
          <JobFacts job={job} />
          <SimpleGrid cols={{ base: 1, md: 2 }} spacing="md">
            <TranscriptPart job={job} />
            <MachinePart job={job} />
          </SimpleGrid>
          <JobRecords job={job} />
        </Stack>
      )}
    </Answered>
  );
}

function TranscriptPart({ job }: { job: JobDetail }) {
  const hash = job.artifacts.transcript;
  const query = useQuery(artifact<Transcript>(job.id, "transcript", hash));
  return (
    <Section title="Transcript">
      {hash === undefined ? (
        <Empty title={job.state === "done" ? "This job has no transcript" : "The transcript comes when the session ends"} />
      ) : (
        <Answered query={query}>{(found) => <TranscriptView turns={found.turns} />}</Answered>
      )}
    </Section>
  );
}

function MachinePart({ job }: { job: JobDetail }) {
  const { view } = route.useSearch();
  const navigate = useNavigate({ from: "/jobs/$id" });
  const hash = job.artifacts.machine;
  const machine = useQuery(artifact<MachineDocument>(job.id, "machine", hash));
  const trials = Object.keys(job.artifacts).filter((name) => name.startsWith("trajectory-")).sort();
  if (hash === undefined) {
    return (
      <Section title="Machine">
        <Empty title={job.state === "done" ? "No machine was finished" : "The machine comes when it is built"}>{job.detail}</Empty>
      </Section>
    );
  }
  return (
    <Section title="Machine">
      <Answered query={machine}>
        {(document) => (
          <Tabs
            value={view ?? "built"}
            keepMounted={false}
            onChange={(value) => {
              void navigate({ search: (before) => ({ ...before, view: value === "trial" ? ("trial" as const) : undefined }), replace: true, resetScroll: false });
            }}
          >
            <Tabs.List mb="sm">
              <Tabs.Tab value="built">As built</Tabs.Tab>
              <Tabs.Tab value="trial" disabled={trials.length === 0}>
                The trial
              </Tabs.Tab>
            </Tabs.List>
            <Tabs.Panel value="built">
              <Suspense fallback={<Loading rows={10} />}>
                <MachineView document={document} />
              </Suspense>
            </Tabs.Panel>
            <Tabs.Panel value="trial">
              <TrialPart job={job} document={document} name={trials.at(-1) ?? ""} />
            </Tabs.Panel>
          </Tabs>
        )}
      </Answered>
    </Section>
  );
}

function TrialPart({ job, document, name }: { job: JobDetail; document: MachineDocument; name: string }) {
  const hash = job.artifacts[name];
  const trial = useQuery({
    queryKey: ["trial", hash],
    enabled: hash !== undefined,
    staleTime: Infinity,
    queryFn: async () => {
      const [{ readTrial }, file] = await Promise.all([
        import("../../scene/trial"),
        bytesOf(`/v1/jobs/${encodeURIComponent(job.id)}/artifacts/${encodeURIComponent(name)}`),
      ]);
      return readTrial(file);
    },
  });
  const task = useQuery(taskQuery(job.task, job.task_version));
  const scenario = task.data?.document.scenario as Scenario | undefined;
  return (
    <Answered query={trial} rows={10}>
      {(found) => (
        <Suspense fallback={<Loading rows={10} />}>
          <TrialView document={document} trial={found} scenario={scenario ?? null} />
        </Suspense>
      )}
    </Answered>
  );
}
