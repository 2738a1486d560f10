import { Button, Stack, Text } from "@mantine/core";
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

/** Replays a scored job without a model, simulates it again, and says which figures came out otherwise. */
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
  const bad = report?.checks.filter((check) => !check.ok) ?? [];
  return (
    <Stack gap="xs" align="start">
      <Button
        variant="default"
        leftSection={<IconShieldCheck size={16} aria-hidden />}
        loading={asked.isPending || (id !== undefined && !found.isError && report == null)}
        onClick={() => asked.mutate()}
      >
        Verify
      </Button>
      <div role="status">
        {report != null && (
          <Text size="sm">
            {report.ok
              ? `✓ all ${report.checks.length} checks hold`
              : `✗ ${bad.length} of ${report.checks.length} checks fail:`}
          </Text>
        )}
        {bad.map(({ name, kept, found: now }) => (
          <Text key={name} size="sm" style={{ overflowWrap: "anywhere" }}>
            {words(name)}: kept {JSON.stringify(kept)}, found {JSON.stringify(now)}
          </Text>
        ))}
      </div>
      {asked.isError && <ProblemNote error={asked.error} />}
      {found.isError && <ProblemNote error={found.error} />}
    </Stack>
  );
}
