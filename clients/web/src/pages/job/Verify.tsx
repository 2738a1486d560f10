import { Button, Popover, Stack, Table, Text } from "@mantine/core";
import { IconShieldCheck } from "@tabler/icons-react";
import { useMutation, useQuery } from "@tanstack/react-query";
import { client, taken } from "../../api/client";
import type { JobDetail } from "../../api/queries";
import { isSite } from "../../api/site";
import { words } from "../../format";
import { ProblemNote } from "../../parts/Problem";

interface Report {
  ok: boolean;
  checks: { name: string; ok: boolean; kept: unknown; found: unknown }[];
}

const ASK_EVERY_MS = 1_000;

/** Replays a scored job without a model, simulates it again, and shows every figure beside its twin. */
export function Verify({ job }: { job: JobDetail }) {
  const asked = useMutation({
    mutationFn: () => taken(client.POST("/v1/jobs/{job_id}/verify", { params: { path: { job_id: job.id } } })),
  });
  const id = asked.data?.id;
  const found = useQuery({
    queryKey: ["verification", id],
    enabled: id !== undefined,
    queryFn: () =>
      taken(client.GET("/v1/verifications/{verification_id}", { params: { path: { verification_id: id ?? "" } } })),
    refetchInterval: (query) => (query.state.data?.state === "done" ? false : ASK_EVERY_MS),
  });
  if (job.success === null || isSite) return null;
  const report = found.data?.report as Report | null | undefined;
  const busy = asked.isPending || (id !== undefined && !found.isError && report == null);
  return (
    <Stack gap="xs" align="end">
      <Button
        variant="default"
        leftSection={<IconShieldCheck size={16} aria-hidden />}
        loading={busy}
        onClick={() => {
          asked.mutate();
        }}
      >
        Verify
      </Button>
      <div role="status">{report != null && <Found report={report} />}</div>
      {asked.isError && <ProblemNote error={asked.error} />}
      {found.isError && <ProblemNote error={found.error} />}
    </Stack>
  );
}

function Found({ report }: { report: Report }) {
  const bad = report.checks.filter((check) => !check.ok).length;
  return (
    <Popover position="bottom-end" width={460} withArrow>
      <Popover.Target>
        <Button size="xs" variant="light" color={report.ok ? "teal" : "red"} c="inherit">
          {report.ok ? `✓ all ${report.checks.length} checks hold` : `✗ ${bad} of ${report.checks.length} checks fail`}
        </Button>
      </Popover.Target>
      <Popover.Dropdown mah={420} style={{ overflow: "auto" }}>
        <Table fz="xs">
          <Table.Thead>
            <Table.Tr>
              <Table.Th>Check</Table.Th>
              <Table.Th>Kept</Table.Th>
              <Table.Th>Found</Table.Th>
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {report.checks.map((check) => (
              <Table.Tr key={check.name}>
                <Table.Td>
                  {check.ok ? "✓" : "✗"} {words(check.name)}
                </Table.Td>
                <Table.Td>{shown(check.kept)}</Table.Td>
                <Table.Td>{shown(check.found)}</Table.Td>
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </Popover.Dropdown>
    </Popover>
  );
}

const LONGEST = 40;

function shown(value: unknown) {
  const text = typeof value === "string" ? value : JSON.stringify(value);
  return (
    <Text span size="xs" title={text}>
      {text.length > LONGEST ? `${text.slice(0, LONGEST)}…` : text}
    </Text>
  );
}
