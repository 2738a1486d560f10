import { Button, Group, Stack, Text, Textarea } from "@mantine/core";
import { useState } from "react";
import type { Hand, SessionView } from "./session";

const SET = "set_controller";
const EXAMPLE = `function control(t, sense)
  return { spinning_forward = t < 2 and 1 or 0 }
end`;

/** Whether the task takes programs. */
export const takesPrograms = (view: SessionView) => view.tools.some((tool) => tool.name === SET);

/** The program that acts in place of keys: written, asked without a trial, tried. */
export function ProgramPanel({ hand }: { hand: Hand }) {
  const stored = hand.bench.controller;
  const [text, setText] = useState<string>();
  const written = text ?? stored;
  const unset = written !== stored;
  return (
    <Stack gap="sm">
      <Textarea
        label="Program, in Lua"
        description="It defines control(t, sense), which is called 25 times a second; the task and its rules list what it senses. Without one, keys are played."
        placeholder={EXAMPLE}
        autosize
        minRows={8}
        maxRows={24}
        spellCheck={false}
        styles={{ input: { fontFamily: "var(--mantine-font-family-monospace)", fontSize: 12 } }}
        value={written}
        onChange={(event) => setText(event.currentTarget.value)}
      />
      <Group gap="xs">
        <Button
          size="xs"
          disabled={hand.busy || !unset}
          onClick={() => hand.act({ tool: SET, arguments: { program: written } })}
        >
          Set the program
        </Button>
        <Button
          size="xs"
          variant="default"
          disabled={hand.busy || unset || stored === ""}
          onClick={() => hand.act({ tool: "test_controller", arguments: {} })}
        >
          What would it do?
        </Button>
        {unset && (
          <Text size="xs" className="dimmed">
            not set yet
          </Text>
        )}
      </Group>
    </Stack>
  );
}
