import { Accordion, Button, Code, Group, Loader, Stack, Text } from "@mantine/core";
import { IconFlask } from "@tabler/icons-react";
import { useMutation, useQueryClient } from "@tanstack/react-query";
import { client, taken } from "../../api/client";
import { number } from "../../format";
import { ProblemNote } from "../../parts/Problem";
import { session as sessionQuery, type SessionView } from "./session";

/** Whether the machine is being tried, and the session continues after that. */
export const isTested = (view: SessionView) => view.test_trials.some((test) => test.result === null);

/** The test trials of a task that has some: what each measured, and the next one. */
export function TestTrials({ view }: { view: SessionView }) {
  const queries = useQueryClient();
  const { id } = view.job;
  const testing = useMutation({
    mutationFn: () =>
      taken(client.POST("/v1/sessions/{session_id}/test-trials", { params: { path: { session_id: id } } })),
    onSuccess: () => queries.invalidateQueries({ queryKey: sessionQuery(id).queryKey }),
  });
  if (view.max_test_trials === 0) return null;
  const left = view.max_test_trials - view.test_trials.length;
  return (
    <Stack gap="xs" aria-label="Test trials" role="region">
      <Group gap="sm">
        <Button
          variant="default"
          leftSection={<IconFlask size={16} aria-hidden />}
          disabled={left === 0 || view.machines.length === 0 || !view.open}
          loading={testing.isPending}
          onClick={() => testing.mutate()}
        >
          Test trial
        </Button>
        <Text size="sm" className="dimmed">
          {left} of {view.max_test_trials} test trials left; they count for nothing.
        </Text>
      </Group>
      {testing.isError && <ProblemNote error={testing.error} />}
      <Accordion multiple variant="separated">
        {view.test_trials.map((test) => (
          <Accordion.Item key={test.number} value={String(test.number)}>
            <Accordion.Control
              disabled={test.result === null}
              icon={test.result === null ? <Loader size="xs" /> : null}
            >
              Test trial {test.number}: {test.result ?? "under way"}
            </Accordion.Control>
            <Accordion.Panel>
              <Code block aria-label="Time, s, and x, y, z of what counts">
                {test.trace.map((row) => row.map((value) => number(value, 2)).join("  ")).join("\n")}
              </Code>
            </Accordion.Panel>
          </Accordion.Item>
        ))}
      </Accordion>
    </Stack>
  );
}
