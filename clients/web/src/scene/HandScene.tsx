import { Html } from "@react-three/drei";
import { useThree } from "@react-three/fiber";
import { useEffect, useMemo } from "react";
import { Box3, Quaternion, Vector3 } from "three";
import { faceAt, type PlacedFace } from "./faces";
import { moduleGeometry } from "./geometry";
import { boundsOf, machineOf, type PartView } from "./machine";
import { asPlaced, Parts } from "./Parts";
import { Shadows } from "./Shadows";
import { Stage } from "./Stage";
import { Surroundings, type Scenario } from "./Surroundings";
import { framed } from "./views";

export interface HandFace extends PlacedFace {
  taken_by: string | null;
}

export interface HandPart extends PartView {
  faces: readonly HandFace[];
}

interface HandSceneProps {
  parts: readonly HandPart[];
  part: HandPart | undefined;
  face: HandFace | undefined;
  /** Where a connector begins that has no end yet. */
  from: HandFace | undefined;
  onPick: (part: string, face: string | undefined) => void;
  subject: string;
  label: string;
  /** The module that would be attached to the chosen face. */
  ghost: string | undefined;
  /** What the machine will be put through, to be seen around it; null for bare ground. */
  course: Scenario | null;
}

const FREE = "#2b8a3e";
const TAKEN = "#e8590c";
const FROM = "#1c7ed6";
const ROOM = 0.6;
const Z = new Vector3(0, 0, 1);

/** A machine under construction: a click on a part chooses it and the face that was clicked. */
export default function HandScene({ parts, part, face, from, onPick, subject, label, course, ghost }: HandSceneProps) {
  const machine = useMemo(() => machineOf(parts), [parts]);
  const bounds = useMemo(() => {
    const own = boundsOf(machine);
    return own.isEmpty() ? new Box3(new Vector3(-1, -1, -1), new Vector3(1, 1, 1)) : own.expandByScalar(ROOM);
  }, [machine]);
  const seen = useMemo(() => framed(bounds, course), [bounds, course]);
  const chosen = useMemo(() => new Set(part === undefined ? [] : [part.id]), [part]);
  return (
    <Stage bounds={seen} height={460} label={label} subject={`${subject} ${course === null}`} scenario={course}>
      <group position={[0, 0, bounds.min.z + (parts.length > 0 ? ROOM : 0) - startHeight(course)]}>
        <Surroundings scenario={course} />
      </group>
      <Shadows machine={machine} pose={asPlaced} ground={bounds.min.z} />
      <Parts
        machine={machine}
        pose={asPlaced}
        chosen={chosen}
        onChoose={(id, hit) => {
          const found = parts.find((one) => one.id === id);
          onPick(id, faceAt(found?.faces ?? [], hit)?.label);
        }}
      />
      <Marks part={part} face={face} from={from} />
      {ghost !== undefined && face !== undefined && face.taken_by === null && <Ghost module={ghost} face={face} />}
    </Stage>
  );
}

/** How high the machine's lowest point is at the start of its trial, units. */
function startHeight(course: Scenario | null): number {
  if (course === null) return 0;
  const { lowest_center, height } = course.placement;
  return lowest_center === undefined ? (height ?? 0) : lowest_center - 0.5;
}

function Marks({ part, face, from }: Pick<HandSceneProps, "part" | "face" | "from">) {
  const invalidate = useThree((state) => state.invalidate);
  useEffect(() => {
    invalidate();
  }, [part, face, from, invalidate]);
  return (
    <>
      {face !== undefined && <Mark face={face} colour={face.taken_by === null ? FREE : TAKEN} />}
      {from !== undefined && <Mark face={from} colour={FROM} />}
      {part?.faces
        .filter((one) => one.taken_by === null)
        .map((one) => (
          <Html
            key={`${part.id} ${one.label}`}
            center
            occlude
            position={lifted(one, 0.12)}
            zIndexRange={[10, 0]}
            wrapperClass="face-letter"
            aria-hidden
          >
            {one.label}
          </Html>
        ))}
    </>
  );
}

/** Where a block would sit, as it sits on a face without a twist. */
function Ghost({ module, face }: { module: string; face: PlacedFace }) {
  const invalidate = useThree((state) => state.invalidate);
  useEffect(() => {
    invalidate();
    return invalidate;
  }, [module, face, invalidate]);
  const turn = new Quaternion().setFromUnitVectors(Z, new Vector3(...face.normal));
  return (
    <mesh geometry={moduleGeometry(module)} position={[...face.center]} quaternion={turn} raycast={() => undefined}>
      <meshLambertMaterial color="#2b8a3e" transparent opacity={0.45} depthWrite={false} />
    </mesh>
  );
}

function Mark({ face, colour }: { face: PlacedFace; colour: string }) {
  const turn = new Quaternion().setFromUnitVectors(Z, new Vector3(...face.normal));
  return (
    <mesh position={lifted(face, 0.03)} quaternion={turn} userData={{ face: face.label }}>
      <planeGeometry args={[0.72, 0.72]} />
      <meshBasicMaterial color={colour} transparent opacity={0.75} depthWrite={false} />
    </mesh>
  );
}

function lifted(face: PlacedFace, by: number): Vector3 {
  return new Vector3(...face.center).addScaledVector(new Vector3(...face.normal), by);
}
