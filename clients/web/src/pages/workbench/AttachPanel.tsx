import { Button, Checkbox, Group, Select, Stack, Text, TextInput } from "@mantine/core";
import { IconLink, IconPlus, IconSearch } from "@tabler/icons-react";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { Answered } from "../../parts/States";
import { mirrored } from "./mirror";
import { modules as modulesQuery, type Hand, type ModuleView } from "./session";

const UNPLACED = new Set(["start", "cargo", "connector"]);

/** The modules whose name or description has all the words. */
export function found(modules: readonly ModuleView[], text: string): ModuleView[] {
  const wanted = text.toLowerCase().split(/\s+/);
  return modules.filter((one) => {
    const text = `${one.name} ${one.kind} ${one.description}`.toLowerCase();
    return wanted.every((word) => text.includes(word));
  });
}

/** What can be put on the chosen face, and connectors between two faces. */
export function AttachPanel({ hand, task }: { hand: Hand; task: { name: string; version: string } }) {
  const query = useQuery(modulesQuery(task.name, task.version));
  if (hand.bench.parts.length === 0) return <Begin hand={hand} />;
  return (
    <Answered query={query} rows={6}>
      {(modules) => (
        <Stack gap="sm">
          <Blocks hand={hand} modules={modules.filter((one) => !UNPLACED.has(one.kind))} />
          <Connectors hand={hand} names={modules.filter((one) => one.kind === "connector").map((one) => one.name)} />
        </Stack>
      )}
    </Answered>
  );
}

function Begin({ hand }: { hand: Hand }) {
  const { available } = hand.bench;
  if (available.length > 0) {
    return (
      <Stack gap="xs">
        <Text size="sm">
          An assembly begins with a copy of a machine. Move and turn it with the tools under “All tools”.
        </Text>
        <Group gap="xs">
          {available.map((name) => (
            <Button
              key={name}
              disabled={hand.busy}
              onClick={() => hand.act({ tool: "add_machine", arguments: { machine_id: name } })}
            >
              Add {name}
            </Button>
          ))}
        </Group>
      </Stack>
    );
  }
  return (
    <Stack gap="xs" align="start">
      <Text size="sm">
        Every machine begins with its starting block. To begin turned or elsewhere, use “start” under “All tools”.
      </Text>
      <Button
        leftSection={<IconPlus size={16} aria-hidden />}
        loading={hand.busy}
        onClick={() => hand.act({ tool: "start", arguments: {} })}
      >
        Place the starting block
      </Button>
    </Stack>
  );
}

function Blocks({ hand, modules }: { hand: Hand; modules: readonly ModuleView[] }) {
  const [text, setText] = useState("");
  const [both, setBoth] = useState(false);
  const { part, face } = hand;
  const where =
    part === undefined
      ? "Choose a part and a face first."
      : face === undefined
        ? `Choose a face of part ${part.id}.`
        : `Attach to ${part.id}/${face.label} (${face.side}):`;
  const shown = found(modules, text);
  return (
    <Stack gap={6}>
      <TextInput
        aria-label="Search modules"
        placeholder="Search modules"
        leftSection={<IconSearch size={16} aria-hidden />}
        value={text}
        onChange={(event) => setText(event.currentTarget.value)}
      />
      <Text size="sm" fw={600} role="status">
        {where}
      </Text>
      <Checkbox
        size="xs"
        label="On the other side too, mirrored between east and west"
        checked={both}
        onChange={(event) => setBoth(event.currentTarget.checked)}
      />
      {shown.map((one) => (
        <Group key={one.name} wrap="nowrap" align="start" gap="sm">
          <Button
            size="xs"
            variant="light"
            style={{ flexShrink: 0 }}
            aria-label={`Attach ${one.name}`}
            disabled={part === undefined || face === undefined || hand.busy}
            onPointerEnter={() => hand.setGhost(one.name)}
            onPointerLeave={() => hand.setGhost(undefined)}
            onFocus={() => hand.setGhost(one.name)}
            onBlur={() => hand.setGhost(undefined)}
            onClick={() => {
              if (part === undefined || face === undefined) return;
              const here = { part: part.id, face: face.label };
              const there = both ? mirrored(hand.bench.parts, here) : undefined;
              hand.act(
                ...[here, ...(there === undefined ? [] : [there])].map((place) => ({
                  tool: "attach_block_to",
                  arguments: { base_block: place.part, face: place.face, new_block: one.name },
                })),
              );
            }}
          >
            Attach
          </Button>
          <div>
            <Text size="sm" fw={600}>
              {one.name}
            </Text>
            <Text size="xs" className="dimmed">
              {one.size === null ? "connector" : one.size.join(" × ")} units · mass {one.mass}
              {one.faces.length > 0 ? ` · faces ${one.faces.join(" ")}` : " · carries nothing"}
            </Text>
            <Text size="xs">{one.description}</Text>
          </div>
        </Group>
      ))}
      {shown.length === 0 && <Text size="sm">No module is called that.</Text>}
    </Stack>
  );
}

function Connectors({ hand, names }: { hand: Hand; names: readonly string[] }) {
  const [name, setName] = useState<string | null>(names[0] ?? null);
  const { part, face, from } = hand;
  if (names.length === 0) return null;
  const here = part === undefined || face === undefined ? undefined : { part: part.id, face: face.label };
  const connect = (): void => {
    if (from === undefined || here === undefined) return;
    hand.act({
      tool: "connect_blocks",
      arguments: { block_a: from.part, face_a: from.face, block_b: here.part, face_b: here.face, connector: name },
    });
    hand.setFrom(undefined);
  };
  return (
    <Stack gap={6}>
      <Text size="sm" fw={600}>
        Connector between two faces
      </Text>
      <Group gap="xs" align="end">
        <Select
          aria-label="Connector"
          data={[...names]}
          value={name}
          onChange={setName}
          allowDeselect={false}
          w={110}
          size="xs"
        />
        <Button size="xs" variant="default" disabled={here === undefined} onClick={() => hand.setFrom(here)}>
          {from === undefined ? "Begin here" : "Begin here instead"}
        </Button>
        <Button
          size="xs"
          leftSection={<IconLink size={14} aria-hidden />}
          disabled={from === undefined || here === undefined || hand.busy}
          onClick={connect}
        >
          End here
        </Button>
      </Group>
      <Text size="xs" className="dimmed" role="status">
        {from === undefined
          ? "Choose a face, begin there; choose another, end there."
          : `It begins on ${from.part}/${from.face}. Choose the face where it ends.`}
      </Text>
    </Stack>
  );
}
