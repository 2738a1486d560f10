import { Badge, Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi } from "@tanstack/react-router";
import type { StreamState } from "../../api/events";
import { every, isSite } from "../../api/site";
import { sweep as sweepQuery, type Sweep } from "../../api/queries";
import { count } from "../../format";
import { Ago } from "../../parts/Ago";
import { JobsSummary } from "../../parts/JobsSummary";
import { JobsTable } from "../../parts/JobsTable";
import { Section } from "../../parts/Section";
import { ProblemNote } from "../../parts/Problem";
import { Answered, Loading } from "../../parts/States";
import { Actions } from "./Actions";
import { Grid } from "./Grid";
import { SweepFacts } from "./SweepFacts";
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
          <SweepFacts sweep={sweep} />
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
                <Stack gap="sm">
                  <JobsSummary search={{ sweep: sweep.id }} />
                  <JobsTable jobs={moment.jobs} />
                </Stack>
              </Section>
            </>
          )}
        </Stack>
      )}
    </Answered>
  );
}

function Head({ sweep, stream }: { sweep: Sweep; stream: StreamState }) {
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
