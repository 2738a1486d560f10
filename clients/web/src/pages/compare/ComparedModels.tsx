import { List, Stack, Table, Text } from "@mantine/core";
import { queryOptions, useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { client, taken, type Schema } from "../../api/client";
import { boardQuery, jobPages, type Job } from "../../api/queries";
import { stateWords, successes, trackLabel } from "../../format";
import { Section } from "../../parts/Section";
import { Heads, useSorting } from "../../parts/SortHead";
import type { Columns } from "../../parts/sorting";
import { Answered, Empty } from "../../parts/States";
import type { Scoped } from "./search";

type Comparison = Schema<"Comparison">;

const comparison = (first: string, second: string, scope: Scoped) =>
  queryOptions({
    queryKey: ["compare", first, second, boardQuery(scope)],
    // The generated client takes pairs for lists of any length.
    queryFn: async () =>
      (await taken(
        client.GET("/v1/leaderboard/compare", { params: { query: { first, second, ...boardQuery(scope) } } }),
      )) as Comparison,
  });

async function endedJobs(model: string, task: string): Promise<Job[]> {
  const [name, configuration = ""] = model.split("@");
  const jobs: Job[] = [];
  for await (const page of jobPages({ model: name, task, state: "done" })) jobs.push(...page);
  return jobs.filter((job) => job.configuration.startsWith(configuration));
}

/** The jobs of two models with the same task and seed that ended differently. */
const cases = (found: Comparison) =>
  queryOptions({
    queryKey: ["compare-cases", found.first, found.second, found.track],
    queryFn: async () => {
      const perTask = await Promise.all(
        found.tasks.map(async ({ task }) => {
          const [a, b] = await Promise.all([endedJobs(found.first, task), endedJobs(found.second, task)]);
          return differing(a, b, found.track);
        }),
      );
      return perTask.flat();
    },
  });

/** Pairs with one seed, task version and track, one a success and the other not. */
export function differing(a: readonly Job[], b: readonly Job[], track: string | null): [Job, Job][] {
  const key = (job: Job): string => `${job.task} ${job.task_version} ${job.seed}`;
  const others = new Map(b.filter((job) => job.track === track).map((job) => [key(job), job]));
  return a.flatMap((job): [Job, Job][] => {
    const other = others.get(key(job));
    const apart =
      other !== undefined && job.track === track && (job.outcome === "success") !== (other.outcome === "success");
    return apart ? [[job, other]] : [];
  });
}

/** Two models on all tasks that both played, with the verdict and the cases where they differ. */
export function ComparedModels({ first, second, scope }: { first: string; second: string; scope: Scoped }) {
  const query = useQuery(comparison(first, second, scope));
  return (
    <Section title={`${first} and ${second}`}>
      <Answered query={query}>
        {(found) =>
          found.tasks.length === 0 ? (
            <Empty title="They share no task on this track" />
          ) : (
            <Stack>
              <Text fw={600} role="status">
                {found.sentence}
              </Text>
              <Duels found={found} />
              <Cases found={found} />
            </Stack>
          )
        }
      </Answered>
    </Section>
  );
}

/** "+40", for a difference of shares in percentage points. */
function points(share: number): string {
  return `${share > 0 ? "+" : share < 0 ? "−" : ""}${Math.abs(100 * share).toFixed(0)}`;
}

function Duels({ found }: { found: Comparison }) {
  const columns: Columns<Comparison["tasks"][number]> = [
    { name: "task", label: "Task", value: (row) => row.task },
    { name: "first", label: found.first, value: (row) => row.successes[0] / row.counted_jobs[0], figures: true },
    { name: "second", label: found.second, value: (row) => row.successes[1] / row.counted_jobs[1], figures: true },
    { name: "difference", label: "Difference, percentage points", value: (row) => row.difference, figures: true },
    { name: "better", label: "Better", value: (row) => row.better },
  ];
  const { rows, head } = useSorting(found.tasks, columns);
  return (
    <div style={{ overflowX: "auto" }} tabIndex={0} role="region" aria-label="Both models task by task, scrolls">
      <Table miw={560} className="figures">
        <Table.Thead>
          <Heads {...head} />
        </Table.Thead>
        <Table.Tbody>
          {rows.map((task) => (
            <Table.Tr key={task.task}>
              <Table.Td>
                <Link to="/tasks/$name" params={{ name: task.task }}>
                  {task.task}
                </Link>
              </Table.Td>
              {[0, 1].map((side) => (
                <Table.Td key={side} className="figures">
                  {successes(task.successes[side] ?? 0)} of {task.counted_jobs[side]}
                </Table.Td>
              ))}
              <Table.Td className="figures">
                {points(task.difference)} (95 %: {points(task.ci_low)} to {points(task.ci_high)})
              </Table.Td>
              <Table.Td>{task.better === null ? "not shown" : found[task.better]}</Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
      <Text size="xs" className="dimmed" mt="xs">
        First minus second, on {found.track === null ? "no protocol" : trackLabel(found.track)}. The tests are those of
        a leaderboard of the two alone.
      </Text>
    </div>
  );
}

function Cases({ found }: { found: Comparison }) {
  const query = useQuery(cases(found));
  return (
    <Answered query={query}>
      {(pairs) => (
        <div>
          <Text size="sm" fw={600}>
            {pairs.length === 0
              ? "On every shared seed both succeeded or both failed."
              : "Where they differ, side by side:"}
          </Text>
          <List size="sm">
            {pairs.map(([a, b]) => (
              <List.Item key={a.id}>
                <Link to="/compare" search={{ a: a.id, b: b.id }}>
                  {a.task}, seed {a.seed}
                </Link>
                : {stateWords(a.outcome ?? a.state)} against {stateWords(b.outcome ?? b.state)}
              </List.Item>
            ))}
          </List>
        </div>
      )}
    </Answered>
  );
}
