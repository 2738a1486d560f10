import { Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { someJobs, type Job, type JobFilters, type TaskDetail } from "../../api/queries";
import { Gallery } from "../../parts/Gallery";
import { Section } from "../../parts/Section";
import { Answered } from "../../parts/States";

const SHOWN = 4;
const LOOKED_AT = 40;

/** Of jobs in an order the first of each kind: a second failure of a kind teaches less than a first of another. */
export function oneOfEach(jobs: readonly Job[], kind: (job: Job) => string, most: number): Job[] {
  const seen = new Map<string, Job>();
  for (const job of jobs) if (!seen.has(kind(job))) seen.set(kind(job), job);
  const rest = jobs.filter((job) => ![...seen.values()].includes(job));
  return [...seen.values(), ...rest].slice(0, most);
}

/** The best machines of a task, or failures that came near, each of another model or reason. */
export function Machines({ task, outcome }: { task: TaskDetail; outcome: "success" | "unsuccessful" }) {
  const of: JobFilters = { task: task.name, task_version: task.version, limit: LOOKED_AT };
  const query = useQuery(someJobs({ ...of, outcome, sort: "indicator" }));
  const kind = (job: Job): string => `${job.model} ${job.reason ?? ""} ${job.flags.join()}`;
  return (
    <Section title={outcome === "success" ? "The best machines" : "Instructive failures"}>
      <Answered query={query} rows={4}>
        {(jobs) =>
          jobs.length === 0 ? (
            <Text size="sm">None yet.</Text>
          ) : (
            <Gallery jobs={oneOfEach(jobs, kind, SHOWN)} unit={task.unit === "1" ? "" : task.unit} by="model" />
          )
        }
      </Answered>
    </Section>
  );
}
