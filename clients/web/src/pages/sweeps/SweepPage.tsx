import { Badge, Button, Group, Progress, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link } from "@tanstack/react-router";
import type { StreamState } from "../../api/events";
import { every, isSite } from "../../api/site";
import { sweep as sweepQuery, type SweepView } from "../../api/queries";
import { compact, count, dollars, duration, number, percent } from "../../format";
import { Fact } from "../../parts/Fact";
import { Ago } from "../../parts/Ago";
import { JobsTable } from "../../parts/JobsTable";
import { Section } from "../../parts/Section";
import { ProblemNote } from "../../parts/Problem";
import { Answered, Loading } from "../../parts/States";
import { Actions } from "./Actions";
import { Grid } from "./Grid";
import type { Rate } from "./live";
import { OutcomeBar, SweepState } from "./SweepsPage";
import { DeadLetters, Troubles } from "./Troubles";
import { useLiveJobs } from "./useLiveJobs";

const route = getRouteApi("/sweeps/$id");
/** A sweep, live: its jobs are read once, and events keep them true. */
export default function SweepPage() {
  const { id } = route.useParams();
  const query = useQuery({
    ...sweepQuery(id),
    refetchInterval: (running) => every(running.state.data?.state === "active" ? 10_000 : 30_000),
  });
  const { moment, complete, stream, error } = useLiveJobs(id);
  return (
    <Answered query={query} rows={10}>
      {(sweep) => (
        <Stack gap="lg">
          <Head sweep={sweep} stream={stream} />
          <Facts sweep={sweep} rate={moment?.rate ?? null} />
          <DeadLetters sweep={sweep} />
          <Troubles id={id} />
          {moment === null && (error === null ? <Loading rows={8} /> : <ProblemNote error={error} />)}
          {moment !== null && (
            <>
              <Section
                title="Model by task"
                aside={
                  !complete && (
                    <Text size="sm" role="status">
                      reading: {count(moment.jobs.length)} of {count(sweep.progress.total)} jobs
                    </Text>
                  )
                }
              >
                <Grid moment={moment} sweep={id} />
              </Section>
              <Section title="Jobs">
                <JobsTable jobs={moment.jobs} />
              </Section>
            </>
          )}
        </Stack>
      )}
    </Answered>
  );
}

function Head({ sweep, stream }: { sweep: SweepView; stream: StreamState }) {
  return (
    <Stack gap={6}>
      <Group justify="space-between" align="start">
        <div>
          <Group gap="sm">
            <Title order={1}>{sweep.name}</Title>
            <SweepState state={sweep.state} />
            {!isSite && <LiveMark state={stream} />}
          </Group>
          <Text size="sm" className="dimmed">
            <span style={{ fontFamily: "monospace" }}>{sweep.id}</span>, submitted <Ago time={sweep.created_at} />
          </Text>
        </div>
        <Group gap="xs">
          <Button
            size="xs"
            variant="default"
            renderRoot={(props) => <Link to="/sweeps/compare" search={{ a: sweep.id }} {...props} />}
          >
            Compare…
          </Button>
          <Actions sweep={sweep} />
        </Group>
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

/** How much of a budget is used; nothing where there is none. */
function shareOf(spent: number | null | undefined, most: number | null | undefined): number | undefined {
  return spent == null || most == null || most === 0 ? undefined : spent / most;
}

function Facts({ sweep, rate }: { sweep: SweepView; rate: Rate | null }) {
  const { progress, budget } = sweep;
  const speed = rate ?? { perMinute: null, leftSeconds: null };
  const running = sweep.state === "active";
  const facts: readonly [string, string, string, number?][] = [
    [
      "Jobs ended",
      `${count(progress.done)} of ${count(progress.total)}`,
      Object.entries(progress.stages)
        .map(([name, n]) => `${n} ${name}`)
        .join(", "),
    ],
    [
      "Rate",
      speed.perMinute === null ? "–" : `${number(speed.perMinute)} a minute`,
      running && (speed.leftSeconds ?? 0) >= 1 ? `about ${duration(speed.leftSeconds)} left` : "",
    ],
    [
      "Spent",
      dollars(progress.cost_usd),
      budget?.max_cost_usd == null ? "no budget in dollars" : `of ${dollars(budget.max_cost_usd)}`,
      shareOf(budget?.spent_cost_usd, budget?.max_cost_usd),
    ],
    [
      "Model requests",
      count(progress.requests),
      budget?.max_requests == null ? "" : `of ${count(budget.max_requests)}`,
      shareOf(budget?.spent_requests, budget?.max_requests),
    ],
    ["Tokens", `${compact(progress.input_tokens)} in`, `${compact(progress.output_tokens)} out`],
  ];
  return (
    <SimpleGrid cols={{ base: 2, sm: 3, md: 5 }}>
      {facts.map(([name, value, note, share]) => (
        <Fact key={name} name={name} value={value}>
          <Text size="xs" className="dimmed">
            {note}
          </Text>
          {share !== undefined && (
            <Progress
              value={Math.min(100, 100 * share)}
              size="sm"
              mt={4}
              color={share > 0.9 ? "orange" : "blue"}
              aria-label={`${name}: ${percent(share)} of the budget`}
            />
          )}
        </Fact>
      ))}
    </SimpleGrid>
  );
}
