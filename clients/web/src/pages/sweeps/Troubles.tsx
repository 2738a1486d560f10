import { Alert, Button, Group, Stack, Table, Text } from "@mantine/core";
import { notifications } from "@mantine/notifications";
import { useMutation, useQuery, useQueryClient } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { client, taken } from "../../api/client";
import { headline } from "../../api/problem";
import { deadLetters, sweepTroubles, type Job, type Sweep, type Trouble } from "../../api/queries";
import { count, words } from "../../format";
import { Ago } from "../../parts/Ago";
import { mayChange, useCaller } from "../../parts/may";
import { Section } from "../../parts/Section";
import { SortHead, useSorting } from "../../parts/SortHead";
import type { Values } from "../../parts/sorting";

const MAX_SHOWN = 20;
const VALUES: Values<Trouble> = {
  what: (row) => row.detail ?? row.result,
  model: (row) => row.model,
  stage: (row) => row.stage,
  attempts: (row) => row.attempts,
  jobs: (row) => row.jobs,
  last: (row) => row.last_at,
};

/** Jobs that faults ended, with their reasons: they are in no average until they are retried. */
export function DeadLetters({ sweep }: { sweep: Sweep }) {
  const errored = sweep.progress.outcomes.errored ?? 0;
  const found = useQuery({ ...deadLetters(sweep.id), enabled: errored > 0 });
  const queries = useQueryClient();
  const who = useCaller();
  const retry = useMutation({
    mutationFn: (id: string) => taken(client.POST("/v1/jobs/{job_id}/retry", { params: { path: { job_id: id } } })),
    onSettled: () => {
      void queries.invalidateQueries({ queryKey: deadLetters(sweep.id).queryKey });
      void queries.invalidateQueries({ queryKey: ["sweep", sweep.id] });
    },
    onError: (error) => {
      notifications.show({ color: "red", title: headline(error), message: error.message });
    },
  });
  if (errored === 0) return null;
  const jobs = found.data?.data ?? [];
  const reasons = new Map<string, number>();
  for (const job of jobs) reasons.set(job.reason ?? "unknown", (reasons.get(job.reason ?? "unknown") ?? 0) + 1);
  const retriable = (job: Job): boolean => mayChange(who, job.key_id) && sweep.state !== "cancelled";
  return (
    <Alert
      color="pink"
      title={`${count(errored)} ${errored === 1 ? "job" : "jobs"} ended by faults, and in no average`}
    >
      <Stack gap={6}>
        <Text size="sm">{[...reasons].map(([reason, n]) => `${n} ${words(reason)}`).join(", ")}</Text>
        {jobs.slice(0, MAX_SHOWN).map((job) => (
          <Group key={job.id} gap="xs" align="start" wrap="nowrap">
            <Text size="sm" style={{ flex: 1, overflowWrap: "anywhere" }}>
              <Link to="/jobs/$id" params={{ id: job.id }}>
                {job.task} by {job.model}, seed {job.seed}
              </Link>
              : {words(job.reason ?? "unknown")}
              {job.detail === null ? "" : `: ${job.detail}`}
            </Text>
            {retriable(job) && (
              <Button
                size="compact-xs"
                variant="default"
                loading={retry.isPending && retry.variables === job.id}
                aria-label={`Retry ${job.task} by ${job.model}, seed ${job.seed}`}
                onClick={() => {
                  retry.mutate(job.id);
                }}
              >
                Retry
              </Button>
            )}
          </Group>
        ))}
        {errored > MAX_SHOWN && (
          <Text size="sm">
            <Link to="/jobs" search={{ sweep: sweep.id, outcome: "errored" }}>
              all {count(errored)}
            </Link>
          </Text>
        )}
      </Stack>
    </Alert>
  );
}

/** What went wrong at providers and workers and was, or is, tried again. */
export function Troubles({ id }: { id: string }) {
  const found = useQuery(sweepTroubles(id)).data ?? [];
  const { rows, head } = useSorting(found, VALUES);
  if (found.length === 0) return null;
  const attempts = found.reduce((sum, one) => sum + one.attempts, 0);
  return (
    <Section title="Trouble at providers and workers">
      <Text size="sm" className="dimmed" mb="xs">
        {count(attempts)} attempts failed and were made again, or will be: faults never count as failures of a model.
      </Text>
      <Table.ScrollContainer
        minWidth={560}
        type="native"
        mah={300}
        tabIndex={0}
        role="region"
        aria-label="Troubles, scrolls"
      >
        <Table fz="sm">
          <Table.Thead>
            <Table.Tr>
              <SortHead name="what" {...head}>
                What
              </SortHead>
              <SortHead name="model" {...head}>
                Model
              </SortHead>
              <SortHead name="stage" {...head}>
                Stage
              </SortHead>
              <SortHead name="attempts" figures {...head}>
                Attempts
              </SortHead>
              <SortHead name="jobs" figures {...head}>
                Jobs
              </SortHead>
              <SortHead name="last" {...head}>
                Last
              </SortHead>
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {rows.map((one) => (
              <Table.Tr key={`${one.model} ${one.stage} ${one.result} ${one.detail ?? ""}`}>
                <Table.Td style={{ overflowWrap: "anywhere" }}>
                  {one.detail ?? (one.result === "lost" ? "its worker was lost" : "a fault")}
                </Table.Td>
                <Table.Td>{one.model}</Table.Td>
                <Table.Td>{one.stage}</Table.Td>
                <Table.Td className="figures">{count(one.attempts)}</Table.Td>
                <Table.Td className="figures">{count(one.jobs)}</Table.Td>
                <Table.Td>
                  <Ago time={one.last_at} />
                </Table.Td>
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </Table.ScrollContainer>
    </Section>
  );
}
