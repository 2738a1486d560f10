import { Button, Group, Stack, Text, Textarea } from "@mantine/core";
import { IconPlayerPlay } from "@tabler/icons-react";
import { useMutation } from "@tanstack/react-query";
import { useState } from "react";
import { ProblemNote } from "../../parts/Problem";
import { SimulatorSelect, useSimulator } from "../../parts/SimulatorSelect";
import { triedAsItStands, type Hand, type SessionView } from "./session";
import { Tried } from "./Tried";

const SET = "set_controller";
const EXAMPLE = `function control(t, sense)
  return { spinning_forward = t < 2 and 1 or 0 }
end`;

/** Whether the task takes programs. */
export const takesPrograms = (view: SessionView) => view.tools.some((tool) => tool.name === SET);

/** The program that acts in place of keys: written, asked without a trial, tried. */
export function ProgramPanel({ hand, view }: { hand: Hand; view: SessionView }) {
  const stored = hand.bench.controller;
  const [text, setText] = useState<string>();
  const written = text ?? stored;
  const unset = written !== stored;
  return (
    <Stack gap="sm">
      <Textarea
        label="Program, in Lua"
        description="It defines control(t, sense), which is called 25 times a second; the task and its rules tell what it senses. Without one, keys are played."
        placeholder={EXAMPLE}
        autosize
        minRows={8}
        maxRows={24}
        spellCheck={false}
        styles={{ input: { fontFamily: "var(--mantine-font-family-monospace)", fontSize: 12 } }}
        value={written}
        onChange={(event) => {
          setText(event.currentTarget.value);
        }}
      />
      <Group gap="xs">
        <Button
          size="xs"
          disabled={hand.busy || !unset}
          onClick={() => {
            hand.act({ tool: SET, arguments: { program: written } });
          }}
        >
          Set the program
        </Button>
        <Button
          size="xs"
          variant="default"
          disabled={hand.busy || unset || stored === ""}
          onClick={() => {
            hand.act({ tool: "test_controller", arguments: {} });
          }}
        >
          What would it do?
        </Button>
        {unset && (
          <Text size="xs" className="dimmed">
            not set yet
          </Text>
        )}
      </Group>
      <LiveTrial view={view} />
    </Stack>
  );
}

function LiveTrial({ view }: { view: SessionView }) {
  const choice = useSimulator();
  const trying = useMutation({
    mutationFn: () => triedAsItStands(view, choice.value),
  });
  return (
    <Stack gap="xs" role="region" aria-label="Live trial">
      <Group gap="xs" align="end">
        <SimulatorSelect choice={choice} />
        <Button
          size="xs"
          variant="light"
          leftSection={<IconPlayerPlay size={14} aria-hidden />}
          loading={trying.isPending}
          disabled={view.machines.length === 0}
          onClick={() => {
            trying.mutate();
          }}
        >
          Try it as it stands
        </Button>
      </Group>
      <Text size="xs" className="dimmed">
        In the task&apos;s exact world, on no leaderboard; the session goes on.
      </Text>
      {trying.isError && <ProblemNote error={trying.error} />}
      {trying.data !== undefined && <Tried key={trying.data.id} id={trying.data.id} />}
    </Stack>
  );
}
