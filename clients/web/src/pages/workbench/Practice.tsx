import { Button, Stack, Text } from "@mantine/core";
import { IconPlayerPlay } from "@tabler/icons-react";
import { useMutation } from "@tanstack/react-query";
import { ProblemNote } from "../../parts/Problem";
import { triedAsItStands, type SessionView } from "./session";
import { Tried } from "./Tried";

/** A trial of the current machine, which counts for nothing; the session continues. */
export function Practice({ view }: { view: SessionView }) {
  const trying = useMutation({
    mutationFn: () => triedAsItStands(view, String(view.job.track.split("/")[1]?.replace(/-[^-]*$/, ""))),
  });
  return (
    <Stack gap="xs" align="start">
      <Text size="sm">
        Try the current machine in a practice world, a little different from the scored one. It counts for nothing.
      </Text>
      <Button
        size="xs"
        variant="light"
        leftSection={<IconPlayerPlay size={14} aria-hidden />}
        loading={trying.isPending}
        disabled={view.machines.length === 0}
        onClick={() => trying.mutate()}
      >
        Practice trial
      </Button>
      {trying.isError && <ProblemNote error={trying.error} />}
      {trying.data !== undefined && <Tried key={trying.data.id} id={trying.data.id} />}
    </Stack>
  );
}
