import { Alert, Group, Stack, Text } from "@mantine/core";
import { useMemo, useState } from "react";
import { boundsOf, readMachine, type MachineDocument } from "./machine";
import { asBuilt, Parts } from "./Parts";
import { Stage } from "./Stage";
import { Surroundings } from "./Surroundings";

/** A machine as it was built; a click on a part says what it is. */
export default function MachineView({ document, height = 420 }: { document: MachineDocument; height?: number }) {
  const [chosen, setChosen] = useState<string | null>(null);
  const machine = useMemo(() => readMachine(document), [document]);
  const bounds = useMemo(() => boundsOf(machine), [machine]);
  if (machine.parts.length === 0) return <Text size="sm">The machine has no parts.</Text>;
  return (
    <Stack gap="xs">
      <Stage bounds={bounds} height={height} label={`The machine: ${machine.parts.length} blocks, ${machine.rods.length} connectors`}>
        <Surroundings scenario={null} floor={bounds.min.z} />
        <Parts machine={machine} pose={asBuilt} chosen={chosen} onChoose={setChosen} />
      </Stage>
      <Group justify="space-between">
        <Text size="sm" className="dimmed">
          {machine.parts.length} blocks, {machine.rods.length} connectors. Drag to turn, scroll to come closer, click a part.
        </Text>
      </Group>
      {chosen !== null && <Chosen document={document} id={chosen} />}
    </Stack>
  );
}

function Chosen({ document, id }: { document: MachineDocument; id: string }) {
  const block = document.blocks.find((one) => one.id === id);
  if (block === undefined) return null;
  const bindings = Object.entries(block.bindings).filter(([, keys]) => keys.length > 0);
  return (
    <Alert color="gray" title={`${block.id}: ${block.module}`} py="xs">
      <Text size="sm">
        {block.mount === null ? "It sits on nothing." : `It sits on face ${block.mount[1]} of block ${block.mount[0]}.`}
        {block.flipped ? " Its spin is flipped." : ""} Its root is at ({block.position.map((value) => value.toFixed(2)).join(", ")}).
        {bindings.map(([action, keys]) => ` ${action}: ${keys.join(", ")}.`).join("")}
      </Text>
      {block.note !== "" && <Text size="sm">“{block.note}”</Text>}
    </Alert>
  );
}
