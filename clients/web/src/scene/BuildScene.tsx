import { useMemo } from "react";
import { Box3 } from "three";
import { Ghosts } from "./Ghosts";
import { boundsOf, machineOf, type PartView, type PlacedView } from "./machine";
import { asPlaced, Parts } from "./Parts";
import { Shadows } from "./Shadows";
import { Stage } from "./Stage";
import { Surroundings } from "./Surroundings";

interface BuildSceneProps {
  parts: ReadonlyMap<string, PartView>;
  ghosts?: readonly PlacedView[];
  /** All parts that the chapter ends with: how large it will be. */
  whole: ReadonlyMap<string, PartView>;
  chosen: ReadonlySet<string>;
  onChoose?: (id: string) => void;
  subject: string;
  label: string;
}

const NONE: readonly PlacedView[] = [];

/** A machine after a step. */
export default function BuildScene({ parts, ghosts = NONE, whole, chosen, onChoose, subject, label }: BuildSceneProps) {
  const machine = useMemo(() => machineOf(parts.values()), [parts]);
  const bounds = useMemo(() => {
    const ends = boundsOf(machineOf(whole.values()));
    const tried = boundsOf(
      machineOf(ghosts.map((block) => ({ ...block, start: null, end: null, flipped: false, bindings: {} }))),
    );
    return new Box3().copy(ends).union(boundsOf(machine)).union(tried);
  }, [machine, whole, ghosts]);
  return (
    <Stage bounds={bounds} height={420} label={label} subject={subject}>
      <Surroundings scenario={null} floor={bounds.isEmpty() ? 0 : bounds.min.z} />
      <Shadows machine={machine} pose={asPlaced} ground={bounds.isEmpty() ? 0 : bounds.min.z} />
      <Parts machine={machine} pose={asPlaced} chosen={chosen} onChoose={onChoose} />
      <Ghosts blocks={ghosts} />
    </Stage>
  );
}
