import { Badge, Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link, useNavigate } from "@tanstack/react-router";
import { board, someJobs, type Board } from "../../api/queries";
import { count, dollars, duration, measured, number, percent, places, secondsBetween } from "../../format";
import { Fact } from "../../parts/Fact";
import { Gallery } from "../../parts/Gallery";
import { JobsSummary } from "../../parts/JobsSummary";
import { Section } from "../../parts/Section";
import { Answered, Empty } from "../../parts/States";
import { refusalsOf, TaskTable } from "../../parts/TaskTable";
import { TrackSelect } from "../../parts/TrackSelect";
import { entriesOf, keyOf } from "../board/entries";
import { oneOfEach } from "../tasks/Machines";

const route = getRouteApi("/models/$");

/** One model: its rank, its best machines, and how it does on each task, the weakest first. */
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
  const track = found.track ?? undefined;
  const shown = found.tasks.flatMap((task) =>
    task.rows
      .filter((row) => row.model === name)
      .map((row) => ({ label: task.task, row, measure: measured(task.indicator, task.unit) })),
  );
  const weakest = shown.sort((a, b) => (a.row.success_rate ?? 0) - (b.row.success_rate ?? 0));
  if (weakest.length === 0) {
    return (
      <Empty title="No run of this model has ended on this track">
        <Link to="/jobs" search={{ model: name }}>
          Its jobs
        </Link>
      </Empty>
    );
  }
  return (
    <>
      {entriesOf(found, true)
        .filter((entry) => entry.model === name)
        .map(({ key, label, baseline }) => (
          <Standing key={key} board={found} of={key} label={label} baseline={baseline} />
        ))}
      <Best name={name} track={track} />
      <Section title="Task by task">
        <Stack gap="sm">
          <JobsSummary search={{ model: name, track, state: "done" }} />
          <TaskTable name={`${name} on each task`} of="Task" shown={weakest} />
          <Text size="sm">{refusalsOf(weakest.map(({ row }) => row))}</Text>
        </Stack>
      </Section>
    </>
  );
}

function Standing({ board, of, label, baseline }: { board: Board; of: string; label: string; baseline: boolean }) {
  const row = board.overall.find((one) => keyOf(one) === of);
  if (row === undefined) return null;
  const facts: readonly [string, string][] = [
    ["Rank", baseline ? "–" : places(row.rank_low, row.rank_high)],
    ["Success", percent(row.success_rate_mean, 1)],
    ["vs. expert", number(row.score_mean, 2)],
    ["$ per run", dollars(row.cost_usd_mean)],
    ["Output tokens per run", count(row.output_tokens_mean)],
    ["Runs", count(row.counted)],
  ];
  const run = board.tasks.length - row.missing.length;
  return (
    <Section
      title={label}
      aside={
        baseline && (
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
          {run} of {board.tasks.length} tasks run. Not yet: {row.missing.join(", ")}.
        </Text>
      )}
    </Section>
  );
}

const LOOKED_AT = 60;
const SHOWN = 8;

/** The model's best machines, at most one a task; and how long its last runs took. */
function Best({ name, track }: { name: string; track: string | undefined }) {
  const of = { model: name, track, limit: LOOKED_AT };
  const query = useQuery(someJobs({ ...of, outcome: "success", sort: "indicator" }));
  const last = useQuery(someJobs({ ...of, state: "done", sort: "finished" }));
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
          Median time per run: {duration(took[Math.floor(took.length / 2)])}
        </Text>
      )}
    </Section>
  );
}
