import { Alert, Badge, Group, Paper, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { board, task as taskQuery, type JobDetail } from "../../api/queries";
import { compact, count, dollars, duration, number, secondsBetween, trackLabel, words } from "../../format";
import { Ago } from "../../parts/Ago";
import { OutcomeBadge } from "../../parts/Outcome";
import { Verify } from "./Verify";

/** Which job this is, and how it ended. */
export function JobHead({ job }: { job: JobDetail }) {
  return (
    <Group justify="space-between" align="start">
      <div>
        <Group gap="sm">
          <Title order={1}>
            <Link className="quiet" to="/tasks/$name" params={{ name: job.task }}>
              {job.task}
            </Link>{" "}
            by{" "}
            <Link className="quiet" to="/models/$" params={{ _splat: job.model }}>
              {job.model}
            </Link>
          </Title>
          <OutcomeBadge value={job.outcome ?? job.state} size="lg" />
        </Group>
        <Text size="sm" className="dimmed">
          <span style={{ fontFamily: "monospace", overflowWrap: "anywhere" }}>{job.id}</span> · seed {job.seed} ·{" "}
          {trackLabel(job.track)} ·{" "}
          {job.finished_at === null ? (
            <>
              submitted <Ago time={job.created_at} />
            </>
          ) : (
            <>
              ended <Ago time={job.finished_at} />
            </>
          )}
        </Text>
        {job.reason !== null && (
          <Text size="sm" mt={4}>
            {words(job.reason)}
            {job.detail === null ? "" : `: ${job.detail}`}
          </Text>
        )}
      </div>
      <Verify job={job} />
    </Group>
  );
}

/** Its score, with what it was judged by, and what it used. */
export function JobFacts({ job }: { job: JobDetail }) {
  const task = useQuery(taskQuery(job.task, job.task_version));
  const unit = task.data?.unit === "1" ? "" : (task.data?.unit ?? "");
  const metrics = Object.entries(job.metrics ?? {}).filter(
    ([, value]) => typeof value === "number" || typeof value === "boolean",
  );
  return (
    <Paper withBorder p="md" component="section" aria-label="Score and usage">
      <SimpleGrid cols={{ base: 2, sm: 3, md: 6 }} spacing="sm">
        <Fact
          name={words(task.data?.indicator ?? "indicator")}
          value={`${job.censored ? "≥ " : ""}${number(job.indicator)}`}
          note={unit}
          strong
        />
        <Fact name="Actions" value={count(job.actions)} note={`${count(job.refused_actions)} refused`} />
        <Fact name="Model requests" value={count(job.usage.requests)} note="" />
        <Fact
          name="Tokens"
          value={job.usage.input_tokens === null ? "–" : `${compact(job.usage.input_tokens)} in`}
          note={job.usage.output_tokens === null ? "" : `${compact(job.usage.output_tokens)} out`}
        />
        <Fact name="Cost" value={dollars(job.usage.cost_usd)} note="" />
        <Fact
          name="Took"
          value={duration(secondsBetween(job.started_at, job.finished_at))}
          note={`${job.attempts.length} attempts`}
        />
      </SimpleGrid>
      {metrics.length > 0 && (
        <Group gap="md" mt="sm">
          {metrics.map(([name, value]) => (
            <Text key={name} size="sm">
              <span className="dimmed">{words(name)}</span>{" "}
              <span className="figures">
                {typeof value === "number" ? number(value, Number.isInteger(value) ? 0 : 2) : String(value)}
              </span>
            </Text>
          ))}
        </Group>
      )}
      <Flags job={job} />
    </Paper>
  );
}

function Flags({ job }: { job: JobDetail }) {
  const flags = job.flags ?? [];
  const query = useQuery({ ...board({ track: job.track }), enabled: flags.length > 0 });
  if (flags.length === 0) return null;
  const meanings = new Map((query.data?.flags ?? []).map((flag) => [flag.name, flag]));
  return (
    <Stack gap="xs" mt="sm">
      {flags.map((name) => (
        <Alert key={name} color={meanings.get(name)?.disqualifying ? "red" : "yellow"} py="xs">
          <Group gap="xs">
            <Badge variant="outline" color="gray" tt="none" styles={{ root: { color: "inherit" } }}>
              {words(name)}
            </Badge>
            <Text size="sm">
              {meanings.get(name)?.meaning ?? ""}
              {meanings.get(name)?.disqualifying ? " It counts as a failure." : ""}
            </Text>
          </Group>
        </Alert>
      ))}
    </Stack>
  );
}

function Fact({ name, value, note, strong }: { name: string; value: string; note: string; strong?: boolean }) {
  return (
    <div>
      <Text size="xs" className="dimmed">
        {name}
      </Text>
      <Text fw={650} size={strong ? "xl" : "lg"} className="figures">
        {value}
      </Text>
      <Text size="xs" className="dimmed">
        {note}
      </Text>
    </div>
  );
}
