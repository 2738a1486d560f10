import { ActionIcon, Button, Checkbox, Group, NumberInput, Select, Stack, Text } from "@mantine/core";
import { IconTrash } from "@tabler/icons-react";
import { useState } from "react";
import { number, words } from "../../format";
import { parametersOf } from "./arguments";
import type { BenchPart, Call, Hand, SessionView } from "./session";

/** The keys that the tools know. */
export function keysOf(view: SessionView): string[] {
  const tool = view.tools.find((one) => one.name === "add_control_sequence");
  return tool === undefined ? [] : (parametersOf(tool).find(([name]) => name === "key")?.[1].enum ?? []);
}

/** Keys bound to actions, and when they are pressed. */
export function KeysPanel({ hand, view, duration }: { hand: Hand; view: SessionView; duration: number }) {
  const powered = hand.bench.parts.filter((part) => part.actions.length > 0);
  return (
    <Stack gap="md">
      {powered.length === 0 ? (
        <Text size="sm">No part takes keys yet: wheels and water cannons do.</Text>
      ) : (
        <Bindings hand={hand} powered={powered} keys={keysOf(view)} />
      )}
      <Presses hand={hand} view={view} duration={duration} />
    </Stack>
  );
}

function Bindings({ hand, powered, keys }: { hand: Hand; powered: readonly BenchPart[]; keys: string[] }) {
  const actions = [...new Set(powered.flatMap((part) => part.actions))];
  const [action, setAction] = useState(actions[0] ?? "");
  const [key, setKey] = useState("UpArrow");
  const [all, setAll] = useState(true);
  const able = powered.filter((part) => part.actions.includes(action));
  const meant = all ? able : able.filter((part) => part.id === hand.part?.id);
  const bind = (): void => {
    hand.act(
      ...meant.map((part): Call => ({
        tool: "change_control_key",
        arguments: { block_id: part.id, action, new_key: key },
      })),
    );
  };
  return (
    <Stack gap={6}>
      <Text size="sm" fw={600}>
        Bind a key
      </Text>
      <Group gap="xs" align="end">
        <Select
          label="Action"
          size="xs"
          data={actions.map((one) => ({ value: one, label: words(one) }))}
          value={action}
          allowDeselect={false}
          onChange={(value) => setAction(value ?? action)}
          w={170}
        />
        <Select
          label="Key"
          size="xs"
          searchable
          data={keys}
          value={key}
          allowDeselect={false}
          onChange={(value) => setKey(value ?? key)}
          w={130}
        />
        <Button size="xs" disabled={hand.busy || meant.length === 0} onClick={bind}>
          Bind
        </Button>
      </Group>
      <Checkbox
        size="xs"
        label={`All ${able.length} parts that can do it, instead of the chosen one`}
        checked={all}
        onChange={(event) => setAll(event.currentTarget.checked)}
      />
      <ul className="bindings">
        {powered.map((part) => (
          <li key={part.id}>
            {part.id} {part.module}
            {part.flipped ? ", flipped" : ""}:{" "}
            {Object.entries(part.bindings)
              .map(([one, bound]) => `${words(one)} ${bound.length === 0 ? "no key" : bound.join(" or ")}`)
              .join(", ")}
          </li>
        ))}
      </ul>
    </Stack>
  );
}

function Presses({ hand, view, duration }: { hand: Hand; view: SessionView; duration: number }) {
  const presses = hand.bench.control_sequence;
  const bound = [...new Set(hand.bench.parts.flatMap((part) => Object.values(part.bindings).flat()))];
  const [key, setKey] = useState<string | null>(null);
  const [time, setTime] = useState<string | number>(0);
  const [hold, setHold] = useState<string | number>(duration);
  const chosen = key ?? bound[0] ?? "UpArrow";
  return (
    <Stack gap={6}>
      <Text size="sm" fw={600}>
        When keys are held, over {number(duration, 0)} seconds
      </Text>
      {presses.map((press, index) => (
        <Group key={index} gap="xs" wrap="nowrap" justify="space-between">
          <Text size="sm" className="figures">
            {press.key} from {press.time_s} s for {press.hold_for_s} s
          </Text>
          <ActionIcon
            variant="subtle"
            color="red"
            aria-label={`Take out press ${index + 1}, ${press.key}`}
            disabled={hand.busy}
            onClick={() => hand.act({ tool: "remove_control_sequence", arguments: { index } })}
          >
            <IconTrash size={16} aria-hidden />
          </ActionIcon>
        </Group>
      ))}
      {presses.length === 0 && <Text size="sm">No key is pressed yet: nothing that is powered would move.</Text>}
      <Group gap="xs" align="end">
        <Select
          label="Key to hold"
          size="xs"
          searchable
          data={keysOf(view)}
          value={chosen}
          allowDeselect={false}
          onChange={setKey}
          w={130}
        />
        <NumberInput label="From, s" size="xs" min={0} value={time} onChange={setTime} w={84} />
        <NumberInput label="For, s" size="xs" min={0} value={hold} onChange={setHold} w={84} />
        <Button
          size="xs"
          disabled={hand.busy}
          onClick={() => {
            hand.act({
              tool: "add_control_sequence",
              arguments: { time: Number(time), key: chosen, hold_for: Number(hold) },
            });
          }}
        >
          Add
        </Button>
      </Group>
    </Stack>
  );
}
