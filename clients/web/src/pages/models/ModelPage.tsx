import { Badge, Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link, useNavigate } from "@tanstack/react-router";
import { lazy, Suspense } from "react";
import { client, taken } from "../../api/client";
import { board, figures, type Board, type Figures, type OverallRow } from "../../api/queries";
import { count, dollars, duration, number, percent, places, secondsBetween } from "../../format";
import { Fact } from "../../parts/Fact";
import { DataTable } from "../../parts/DataTable";
import { JobsSummary } from "../../parts/JobsSummary";
import { Gallery } from "../../parts/Gallery";
import { Section } from "../../parts/Section";
import { Answered, Empty, Loading } from "../../parts/States";
import { TaskTable } from "../../parts/TaskTable";
import { TrackSelect } from "../../parts/TrackSelect";
import { entriesOf, keyOf, type Entry } from "../board/entries";
import { oneOfEach } from "../tasks/Machines";

const Drawings = lazy(() => import("./Drawings"));
const route = getRouteApi("/models/$");

/** One model over tasks and dimensions. */
export default function ModelPage() {
  const { _splat: name = "" } = route.useParams();
  const { track } = route.useSearch();
  const navigate = useNavigate({ from: "/models/$" });
  const query = useQuery(board({ track }));
  return (
    <Stack gap="lg">
      <Group justify="space-between">
        <Title order={1}>{name}</Title>
        {query.data !== undefined && (
          <TrackSelect
            known={query.data.tracks}
            chosen={query.data.track}
            onTrack={(to) => void navigate({ search: { track: to }, replace: true })}
          />
        )}
      </Group>
      <Answered query={query}>{(found) => <Profile board={found} name={name} />}</Answered>
    </Stack>
  );
}

function Profile({ board: found, name }: { board: Board; name: string }) {
  const drawn = useQuery(figures({ track: found.track ?? undefined }));
  const tasks = found.tasks
    .map((task) => ({ ...task, rows: task.rows.filter((row) => row.model === name) }))
    .filter((task) => task.rows.length > 0);
  if (tasks.length === 0) {
    return (
      <Empty title="No job of this model has ended on this track">
        <Link to="/jobs" search={{ model: name }}>
          Its jobs
        </Link>
      </Empty>
    );
  }
  const entries = entriesOf(found, true).filter((entry) => entry.model === name);
  return (
    <>
      {entries.map((entry) => (
        <Standing key={entry.key} entry={entry} row={found.overall.find((row) => keyOf(row) === entry.key)} />
      ))}
      <Answered query={drawn} rows={8}>
        {(shown: Figures) => (
          <Suspense fallback={<Loading rows={8} />}>
            <Drawings figures={shown} entries={entries} />
          </Suspense>
        )}
      </Answered>
      <Best name={name} track={found.track ?? undefined} />
      <Section title="Task by task">
        <JobsSummary search={{ model: name, track: found.track ?? undefined, state: "done" }} />
        <Stack gap="lg" mt="md">
          {tasks.map((task) => (
            <div key={task.task}>
              <Link className="quiet" to="/tasks/$name" params={{ name: task.task }}>
                <Title order={3} size="h5" mb={4}>
                  {task.task}
                </Title>
              </Link>
              <TaskTable task={task} />
            </div>
          ))}
        </Stack>
        <Effort tasks={tasks} />
      </Section>
    </>
  );
}

function Standing({ entry, row }: { entry: Entry; row: OverallRow | undefined }) {
  if (row === undefined) return null;
  const facts: readonly [string, string][] = [
    ["Rank", row.rank === null ? "–" : String(row.rank)],
    ["Place, 95 % interval", places(row.rank_low, row.rank_high)],
    ["Mean rank", number(row.mean_rank, 2)],
    ["Success, mean of tasks", percent(row.success_rate_mean, 1)],
    ["Dollars a job", dollars(row.cost_usd_mean)],
    ["Output tokens a job", count(row.output_tokens_mean)],
    ["Trials", count(row.counted)],
  ];
  return (
    <Section
      title={entry.label === entry.model ? "Overall" : entry.label}
      aside={
        entry.baseline && (
          <Badge variant="outline" color="gray" tt="none" styles={{ root: { color: "inherit" } }}>
            baseline
          </Badge>
        )
      }
    >
      <Group gap="xl">
        {facts.map(([name, value]) => (
          <Fact key={name} name={name} value={value} />
        ))}
      </Group>
      {row.missing.length > 0 && (
        <Text size="sm" className="dimmed">
          Not ranked: no counted job on {row.missing.join(", ")}.
        </Text>
      )}
    </Section>
  );
}

/** What a job of the model takes, task by task. */
function Effort({ tasks }: { tasks: Board["tasks"] }) {
  const rows = tasks.flatMap((task) =>
    task.rows.map((row) => [
      task.task,
      count(row.requests_mean),
      count(row.input_tokens_mean),
      count(row.output_tokens_mean),
      dollars(row.cost_usd_mean),
      percent(row.refused_action_rate, 1),
    ]),
  );
  return (
    <DataTable
      name="Effort a job"
      title="What a job takes: requests, tokens, dollars"
      columns={["Task", "Requests", "Tokens in", "Tokens out", "$ a job", "Refused"]}
      rows={rows}
    />
  );
}

const LOOKED_AT = 60;
const SHOWN = 8;

/** The model's best machines, at most one a task; and how long its last jobs took. */
function Best({ name, track }: { name: string; track: string | undefined }) {
  const query = useQuery({
    queryKey: ["best", name, track],
    queryFn: async () =>
      (
        await taken(
          client.GET("/v1/jobs", {
            params: {
              query: {
                model: [name],
                track: track === undefined ? track : [track],
                outcome: ["success"],
                sort: "indicator",
                limit: LOOKED_AT,
              },
            },
          }),
        )
      ).data,
  });
  const last = useQuery({
    queryKey: ["latency", name, track],
    queryFn: async () =>
      (
        await taken(
          client.GET("/v1/jobs", {
            params: {
              query: {
                model: [name],
                track: track === undefined ? track : [track],
                state: ["done"],
                sort: "finished",
                limit: LOOKED_AT,
              },
            },
          }),
        )
      ).data,
  });
  const took = (last.data ?? [])
    .flatMap((job) => secondsBetween(job.started_at, job.finished_at) ?? [])
    .sort((a, b) => a - b);
  return (
    <Section title="Its best machines">
      <Answered query={query} rows={4}>
        {(jobs) =>
          jobs.length === 0 ? (
            <Text size="sm">None has succeeded.</Text>
          ) : (
            <Gallery jobs={oneOfEach(jobs, (job) => job.task, SHOWN)} by="task" />
          )
        }
      </Answered>
      {took.length > 0 && (
        <Text size="sm" mt="sm">
          Latency: its last {count(took.length)} jobs took {duration(took[Math.floor(took.length / 2)])} in the middle,{" "}
          {duration(took.at(-1))} at most, from start to end, simulation included.
        </Text>
      )}
    </Section>
  );
}
