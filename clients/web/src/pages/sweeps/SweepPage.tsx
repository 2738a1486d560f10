import { Alert, Badge, Button, Group, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery, useQueryClient } from "@tanstack/react-query";
import { getRouteApi, Link } from "@tanstack/react-router";
import { useCallback, useRef } from "react";
import { useEvents, type ServiceEvent, type StreamState } from "../../api/events";
import { sweep as sweepQuery, sweepJobs, type JobView, type SweepView } from "../../api/queries";
import { compact, count, dollars, duration, number } from "../../format";
import { Ago } from "../../parts/Ago";
import { JobsTable } from "../../parts/JobsTable";
import { Section } from "../../parts/Section";
import { Answered } from "../../parts/States";
import { Actions } from "./Actions";
import { Grid } from "./Grid";
import { applyEvents, rate } from "./live";
import { OutcomeBar, SweepState } from "./SweepsPage";

const route = getRouteApi("/sweeps/$id");
const REFRESH_MS = 1_500;

/** A sweep, live: its jobs are read once, and events keep them true. */
export default function SweepPage() {
  const { id } = route.useParams();
  const queries = useQueryClient();
  const query = useQuery({
    ...sweepQuery(id),
    refetchInterval: (running) => (running.state.data?.state === "done" ? 15_000 : 5_000),
  });
  const jobs = useQuery(sweepJobs(id));
  const stream = useLiveJobs(id, jobs.data !== undefined);
  return (
    <Answered query={query} rows={10}>
      {(sweep) => (
        <Stack gap="lg">
          <Head sweep={sweep} stream={stream} />
          <Facts sweep={sweep} jobs={jobs.data ?? []} />
          <Answered query={jobs} rows={8}>
            {(found) => (
              <>
                <Errored jobs={found} />
                <Section title="Model by task">
                  <Grid jobs={found} sweep={id} />
                </Section>
                <Section
                  title="Jobs"
                  aside={
                    <Button
                      size="xs"
                      variant="default"
                      onClick={() => {
                        void queries.invalidateQueries({ queryKey: ["sweep-jobs", id] });
                      }}
                    >
                      Read again
                    </Button>
                  }
                >
                  <JobsTable jobs={found} />
                </Section>
              </>
            )}
          </Answered>
        </Stack>
      )}
    </Answered>
  );
}

/** Applies events to the jobs that were read, and reads the sweep's figures again now and then. */
function useLiveJobs(id: string, ready: boolean): StreamState {
  const queries = useQueryClient();
  const due = useRef(false);
  const onEvents = useCallback(
    (events: ServiceEvent[]) => {
      queries.setQueryData(sweepJobs(id).queryKey, (before: JobView[] | undefined) =>
        before === undefined ? before : (applyEvents(before, events) as JobView[]),
      );
      if (due.current) return;
      due.current = true;
      setTimeout(() => {
        due.current = false;
        void queries.invalidateQueries({ queryKey: sweepQuery(id).queryKey });
      }, REFRESH_MS);
    },
    [id, queries],
  );
  return useEvents(ready ? `/v1/sweeps/${encodeURIComponent(id)}/events` : null, onEvents);
}

function Head({ sweep, stream }: { sweep: SweepView; stream: StreamState }) {
  return (
    <Stack gap={6}>
      <Group justify="space-between" align="start">
        <div>
          <Group gap="sm">
            <Title order={1}>{sweep.name}</Title>
            <SweepState state={sweep.state} />
            <LiveMark state={stream} />
          </Group>
          <Text size="sm" className="dimmed">
            <span style={{ fontFamily: "monospace" }}>{sweep.id}</span>, submitted <Ago time={sweep.created_at} />
          </Text>
        </div>
        <Actions sweep={sweep} />
      </Group>
      <OutcomeBar sweep={sweep} size={16} />
    </Stack>
  );
}

function LiveMark({ state }: { state: StreamState }) {
  const [label, colour] = {
    live: ["live", "teal"],
    connecting: ["connecting", "gray"],
    broken: ["not live: connecting again", "yellow"],
  }[state] as [string, string];
  return (
    <Badge variant="dot" color={colour} tt="none" role="status">
      {label}
    </Badge>
  );
}

function Facts({ sweep, jobs }: { sweep: SweepView; jobs: readonly JobView[] }) {
  const { progress, budget } = sweep;
  const speed = rate(jobs);
  const running = sweep.state === "active";
  const facts: readonly [string, string, string][] = [
    ["Jobs ended", `${count(progress.done)} of ${count(progress.total)}`, Object.entries(progress.stages).map(([name, n]) => `${n} ${name}`).join(", ")],
    ["Rate", speed.perMinute === null ? "–" : `${number(speed.perMinute)} a minute`, running && speed.leftSeconds !== null ? `about ${duration(speed.leftSeconds)} left` : ""],
    ["Spent", dollars(progress.cost_usd), budget?.max_cost_usd == null ? "no budget in dollars" : `of ${dollars(budget.max_cost_usd)}`],
    ["Model requests", count(progress.requests), budget?.max_requests == null ? "" : `of ${count(budget.max_requests)}`],
    ["Tokens", `${compact(progress.input_tokens)} in`, `${compact(progress.output_tokens)} out`],
  ];
  return (
    <SimpleGrid cols={{ base: 2, sm: 3, md: 5 }}>
      {facts.map(([name, value, note]) => (
        <div key={name}>
          <Text size="xs" className="dimmed">
            {name}
          </Text>
          <Text fw={650} size="lg" className="figures">
            {value}
          </Text>
          <Text size="xs" className="dimmed">
            {note}
          </Text>
        </div>
      ))}
    </SimpleGrid>
  );
}

const MAX_SHOWN = 8;

/** Jobs that faults ended, with their reasons: they are in no average until they are retried. */
function Errored({ jobs }: { jobs: readonly JobView[] }) {
  const errored = jobs.filter((job) => job.outcome === "errored");
  if (errored.length === 0) return null;
  return (
    <Alert color="pink" title={`${errored.length} job${errored.length > 1 ? "s" : ""} ended by faults`}>
      <Stack gap={4}>
        {errored.slice(0, MAX_SHOWN).map((job) => (
          <Text key={job.id} size="sm">
            <Link to="/jobs/$id" params={{ id: job.id }}>
              {job.task} by {job.model}, seed {job.seed}
            </Link>
            {job.detail === null ? "" : `: ${job.detail}`}
          </Text>
        ))}
        {errored.length > MAX_SHOWN && <Text size="sm">and {errored.length - MAX_SHOWN} more</Text>}
      </Stack>
    </Alert>
  );
}
