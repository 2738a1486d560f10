import { useMemo, useState } from "react";
import { Text } from "@mantine/core";
import { boundsOf, readScene, type MachineScene } from "./machine";
import { asPlaced, Parts } from "./Parts";
import { Shadows } from "./Shadows";
import { Stage } from "./Stage";
import { Surroundings } from "./Surroundings";

/** A machine as its file has it; a click names a part. */
export default function FileScene({ scene, label }: { scene: MachineScene; label: string }) {
  const machine = useMemo(() => readScene(scene), [scene]);
  const bounds = useMemo(() => boundsOf(machine), [machine]);
  const [chosen, setChosen] = useState<string | null>(null);
  const marked = useMemo(() => new Set(chosen === null ? [] : [chosen]), [chosen]);
  const part = [...machine.parts, ...machine.rods].find((one) => one.id === chosen);
  return (
    <>
      <Stage bounds={bounds} height={420} label={label} subject={label}>
        <Surroundings scenario={null} floor={bounds.isEmpty() ? 0 : bounds.min.z} />
        <Shadows machine={machine} pose={asPlaced} ground={bounds.isEmpty() ? 0 : bounds.min.z} />
        <Parts machine={machine} pose={asPlaced} chosen={marked} onChoose={setChosen} />
      </Stage>
      <Text size="xs" className="dimmed" role="status">
        {part === undefined
          ? "Drag to turn, scroll to come closer, click a part to read what it is."
          : `${part.id}: ${part.module}`}
      </Text>
    </>
  );
}
