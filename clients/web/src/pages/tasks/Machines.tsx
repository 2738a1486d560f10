import { Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { client, taken } from "../../api/client";
import { asQuery } from "../../api/queries";
import type { JobFilters, Job, TaskDetail } from "../../api/queries";
import { Gallery } from "../../parts/Gallery";
import { Section } from "../../parts/Section";
import { Answered } from "../../parts/States";

const SHOWN = 4;
const LOOKED_AT = 40;

function someJobs(filters: JobFilters) {
  return {
    queryKey: ["some-jobs", filters],
    queryFn: async () => (await taken(client.GET("/v1/jobs", { params: { query: asQuery(filters) } }))).data,
  };
}

/** Of jobs in an order the first of each kind: a second failure of a kind teaches less than a first of another. */
export function oneOfEach(jobs: readonly Job[], kind: (job: Job) => string, most: number): Job[] {
  const seen = new Map<string, Job>();
  for (const job of jobs) if (!seen.has(kind(job))) seen.set(kind(job), job);
  const rest = jobs.filter((job) => ![...seen.values()].includes(job));
  return [...seen.values(), ...rest].slice(0, most);
}

/** The best machines of a task, and failures that came near or failed in ways of their own. */
export function Machines({ task }: { task: TaskDetail }) {
  const of: JobFilters = { task: task.name, task_version: task.version };
  const best = useQuery(someJobs({ ...of, outcome: "success", sort: "indicator", limit: LOOKED_AT }));
  const failed = useQuery(someJobs({ ...of, outcome: "unsuccessful", sort: "indicator", limit: LOOKED_AT }));
  return (
    <Section title="Machines">
      <Stack gap="md">
        <div>
          <Title order={3} size="h5" mb="xs">
            The best
          </Title>
          <Answered query={best} rows={4}>
            {(jobs) =>
              jobs.length === 0 ? (
                <Text size="sm">No machine has succeeded yet.</Text>
              ) : (
                <Gallery
                  jobs={oneOfEach(jobs, (job) => job.model, SHOWN)}
                  unit={task.unit === "1" ? "" : task.unit}
                  by="model"
                />
              )
            }
          </Answered>
        </div>
        <div>
          <Title order={3} size="h5" mb={2}>
            Instructive failures
          </Title>
          <Text size="xs" className="dimmed" mb="xs">
            Machines that were tried and failed: of each model and reason the one that came nearest.
          </Text>
          <Answered query={failed} rows={4}>
            {(jobs) =>
              jobs.length === 0 ? (
                <Text size="sm">No finished machine has failed.</Text>
              ) : (
                <Gallery
                  jobs={oneOfEach(jobs, (job) => `${job.model} ${job.reason ?? ""} ${(job.flags ?? []).join()}`, SHOWN)}
                  unit={task.unit === "1" ? "" : task.unit}
                  by="model"
                />
              )
            }
          </Answered>
        </div>
      </Stack>
    </Section>
  );
}
