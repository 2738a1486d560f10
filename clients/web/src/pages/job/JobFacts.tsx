import { Alert, Group, Stack, Table, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { board, task as taskQuery, type JobDetail } from "../../api/queries";
import { isSite } from "../../api/site";
import { compact, count, counted, dollars, number, trackLabel, words } from "../../format";
import { useEffect } from "react";
import { RelativeTime } from "../../parts/RelativeTime";
import { OutcomeBadge } from "../../parts/Outcome";
import { transcript as transcriptQuery } from "./queries";
import { timesOf } from "./times";
import { Verify } from "./Verify";
import { worldLine } from "./worlds";

/** Which run this is, how it ended and why, and what it took. */
export function JobHead({ job }: { job: JobDetail }) {
  const task = useQuery(taskQuery(job.task, job.task_version)).data;
  const title = `${task?.title ?? job.task} · ${job.model}`;
  useEffect(() => {
    document.title = `${title} · BuildArena`;
  }, [title]);
  return (
    <Stack gap={6}>
      <Title order={1}>
        <Link className="quiet" to="/tasks/$name" params={{ name: job.task }}>
          {task?.title ?? job.task}
        </Link>
        {" · "}
        <Link className="quiet" to="/models/$" params={{ _splat: job.model }}>
          {job.model}
        </Link>
      </Title>
      <Group gap="sm">
        <OutcomeBadge value={job.outcome ?? job.state} size="lg" />
        <Text component="div" style={{ flex: 1, minWidth: 260 }}>
          {sentenceOf(job)} <FirstMistake job={job} />
        </Text>
        {job.artifacts.machine !== undefined && !isSite && (
          <Link to="/build" search={{ task: job.task, remix: job.id }}>
            Remix it
          </Link>
        )}
      </Group>
      <Text size="sm" className="dimmed">
        {job.indicator !== null &&
          `${words(task?.indicator ?? "result")} ${job.censored ? "≥ " : ""}${number(job.indicator)} · `}
        {counted(job.usage.requests ?? 0, "request")} · {dollars(job.usage.cost_usd)} · {timesOf(job)} · {job.task},
        seed {job.seed} · {trackLabel(job.track)} · {job.finished_at === null ? "submitted " : "ended "}
        <RelativeTime time={job.finished_at ?? job.created_at} />
      </Text>
      {job.worlds.length > 1 && (
        <Text size="sm" component="ul" className="worlds" aria-label="Scored trials">
          {job.worlds.map((world) => (
            <li key={world.rollout} title={world.explanation}>
              {worldLine(world, job.worlds)}
            </li>
          ))}
        </Text>
      )}
      <Flags job={job} />
    </Stack>
  );
}

/** Why it ended so, in a sentence; the scorer's own where there is one. */
function sentenceOf({ explanation, reason, detail }: JobDetail): string {
  if (explanation !== null) return explanation;
  return [reason === null ? null : words(reason), detail].filter((part) => part !== null).join(": ");
}

/** Where a run that failed was first refused something. */
function FirstMistake({ job }: { job: JobDetail }) {
  const turns = useQuery({ ...transcriptQuery(job.id), enabled: job.success === 0 }).data?.turns ?? [];
  const first = turns.find((turn) => turn.actions.some((action) => !action.ok));
  if (job.success !== 0 || first === undefined) return null;
  return (
    <>
      The first of {counted(job.refused_actions, "refused action")} is in{" "}
      <Link to="/jobs/$id" params={{ id: job.id }} search={{ turn: first.index }}>
        turn {first.index}
      </Link>
      .
    </>
  );
}

/** Everything that was measured, and used. */
export function Measurements({ job }: { job: JobDetail }) {
  const task = useQuery(taskQuery(job.task, job.task_version)).data;
  const metrics = Object.entries(job.metrics).flatMap(([name, value]): [string, string][] => {
    if (typeof value === "boolean") return [[words(name), value ? "yes" : "no"]];
    return typeof value === "number" ? [[words(name), number(value, Number.isInteger(value) ? 0 : 2)]] : [];
  });
  const { usage } = job;
  const rows: [string, string][] = [
    [words(task?.indicator ?? "result"), `${job.censored ? "≥ " : ""}${number(job.indicator)}`],
    ...metrics,
    ["actions", `${count(job.actions)}, ${count(job.refused_actions)} refused`],
    ["model requests", count(usage.requests)],
    ["tokens", `${compact(usage.input_tokens)} in, ${compact(usage.output_tokens)} out`],
    ["cost", dollars(usage.cost_usd)],
    ...Object.entries(job.retries).map(([cause, times]): [string, string] => ["asked again", `${times} × ${cause}`]),
  ];
  return (
    <Stack align="start">
      <Table fz="sm" maw={560} aria-label="Measurements">
        <Table.Tbody>
          {rows.map(([name, value]) => (
            <Table.Tr key={`${name} ${value}`}>
              <Table.Th scope="row" fw={500}>
                {name}
              </Table.Th>
              <Table.Td className="figures">{value}</Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
      <Verify job={job} />
    </Stack>
  );
}

function Flags({ job }: { job: JobDetail }) {
  const flags = job.flags;
  const query = useQuery({ ...board({ track: job.track }), enabled: flags.length > 0 });
  const meanings = new Map((query.data?.flags ?? []).map((flag) => [flag.name, flag]));
  return flags.map((name) => (
    <Alert key={name} color={meanings.get(name)?.disqualifying ? "red" : "yellow"} py="xs" title={words(name)}>
      {meanings.get(name)?.meaning}
      {meanings.get(name)?.disqualifying && " It counts as a failure."}
    </Alert>
  ));
}
