import { Stack, Table, Text } from "@mantine/core";
import { queryOptions, useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { client, taken, type Schema } from "../../api/client";
import type { JobView } from "../../api/queries";
import { number, percent, successes, words } from "../../format";
import { OutcomeBadge } from "../../parts/Outcome";
import { Section } from "../../parts/Section";
import { Answered, Empty } from "../../parts/States";

type Comparison = Schema<"Comparison">;

const comparison = (first: string, second: string, track: string | undefined) =>
  queryOptions({
    queryKey: ["compare", first, second, track ?? ""],
    // The generated client takes pairs for lists of any length.
    queryFn: async () =>
      (await taken(
        client.GET("/v1/leaderboard/compare", { params: { query: { first, second, track } } }),
      )) as Comparison,
  });

async function endedJobs(model: string, task: string): Promise<JobView[]> {
  const query = { model: model.split("@")[0], task, state: "done" as const, limit: 1000 };
  return (await taken(client.GET("/v1/jobs", { params: { query } }))).jobs;
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
export function differing(a: readonly JobView[], b: readonly JobView[], track: string | null): [JobView, JobView][] {
  const key = (job: JobView): string => `${job.task} ${job.task_version} ${job.seed}`;
  const others = new Map(b.filter((job) => job.track === track).map((job) => [key(job), job]));
  return a.flatMap((job): [JobView, JobView][] => {
    const other = others.get(key(job));
    const apart =
      other !== undefined && job.track === track && (job.outcome === "success") !== (other.outcome === "success");
    return apart ? [[job, other]] : [];
  });
}

/** Two models on all tasks that both played, with the paired test and the cases where they differ. */
export function ComparedModels({ first, second, track }: { first: string; second: string; track: string | undefined }) {
  const query = useQuery(comparison(first, second, track));
  return (
    <Section title={`${first} and ${second}`}>
      <Answered query={query}>
        {(found) =>
          found.tasks.length === 0 ? (
            <Empty title="They share no task on this track" />
          ) : (
            <Stack>
              <Duels found={found} />
              <Cases found={found} />
            </Stack>
          )
        }
      </Answered>
    </Section>
  );
}

function p(value: number | null | undefined): string {
  if (value === null || value === undefined) return "–";
  return value < 0.001 ? "< 0.001" : value.toFixed(3);
}

function Duels({ found }: { found: Comparison }) {
  return (
    <div style={{ overflowX: "auto" }} tabIndex={0} role="region" aria-label="Both models task by task, scrolls">
      <Table miw={760} className="figures">
        <Table.Thead>
          <Table.Tr>
            <Table.Th>Task</Table.Th>
            <Table.Th className="figures">{found.first}</Table.Th>
            <Table.Th className="figures">{found.second}</Table.Th>
            <Table.Th className="figures">Difference, 95 %</Table.Th>
            <Table.Th>Success, paired test</Table.Th>
            <Table.Th>Indicator, paired test</Table.Th>
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {found.tasks.map((task) => (
            <Table.Tr key={task.task}>
              <Table.Td>
                <Link to="/tasks/$name" params={{ name: task.task }}>
                  {task.task}
                </Link>
              </Table.Td>
              {[0, 1].map((side) => (
                <Table.Td key={side} className="figures">
                  {successes(task.successes[side] ?? 0)} of {task.trials[side]}
                </Table.Td>
              ))}
              <Table.Td className="figures">
                {percent(task.difference)} ({percent(task.low)} to {percent(task.high)})
              </Table.Td>
              <Table.Td>
                <Tested test={task.success} adjusted={task.success_p} />
              </Table.Td>
              <Table.Td>
                <Tested test={task.indicator} adjusted={task.indicator_p} />
              </Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
      <Text size="xs" className="dimmed" mt="xs">
        Paired on shared seeds; p adjusted over all tests of this table (Holm). Track: {found.track}.
      </Text>
    </div>
  );
}

function Tested({ test, adjusted }: { test: Schema<"TestView"> | null; adjusted: number | null }) {
  if (test === null) return <Text size="sm">no shared seeds</Text>;
  return (
    <Text size="sm">
      p = {p(adjusted)}, {test.pairs} pairs ({test.method})
    </Text>
  );
}

function Cases({ found }: { found: Comparison }) {
  const query = useQuery(cases(found));
  return (
    <Answered query={query}>
      {(pairs) =>
        pairs.length === 0 ? (
          <Text size="sm">On every shared seed both succeeded or both failed.</Text>
        ) : (
          <div
            style={{ overflow: "auto", maxHeight: 480 }}
            tabIndex={0}
            role="region"
            aria-label="Cases where they differ, scrolls"
          >
            <Table miw={620}>
              <Table.Thead>
                <Table.Tr>
                  <Table.Th>Cases where they differ</Table.Th>
                  <Table.Th>{found.first}</Table.Th>
                  <Table.Th>{found.second}</Table.Th>
                </Table.Tr>
              </Table.Thead>
              <Table.Tbody>
                {pairs.map(([a, b]) => (
                  <Table.Tr key={a.id}>
                    <Table.Td>
                      <Link to="/compare" search={{ a: a.id, b: b.id }}>
                        {a.task}, seed {a.seed}
                      </Link>
                    </Table.Td>
                    {[a, b].map((job) => (
                      <Table.Td key={job.id}>
                        <OutcomeBadge value={job.outcome ?? job.state} size="sm" /> {number(job.indicator)}{" "}
                        <span className="dimmed">{job.reason === null ? "" : words(job.reason)}</span>
                      </Table.Td>
                    ))}
                  </Table.Tr>
                ))}
              </Table.Tbody>
            </Table>
          </div>
        )
      }
    </Answered>
  );
}
