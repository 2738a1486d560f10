import { useFrame, useThree } from "@react-three/fiber";
import { useEffect, useMemo, useRef, type RefObject } from "react";
import { Matrix4, Vector3, type Mesh } from "three";
import type { Machine, Part } from "./machine";
import { Parts, type PoseNow } from "./Parts";
import { cargoAt, poseAt } from "./playing";
import type { Trial } from "./trial";

interface Orbit {
  target: Vector3;
  update: () => void;
}

/** The moving things of a trial; frames are drawn while it plays, and when somebody seeks. */
export function Film({
  machine,
  trial,
  time,
  shown,
  playing,
  follow,
  colour,
}: {
  machine: Machine;
  trial: Trial;
  time: RefObject<number>;
  shown: number;
  playing: boolean;
  follow: boolean;
  colour: (part: Part) => string | null;
}) {
  const { invalidate, camera } = useThree();
  const controls = useThree((state) => state.controls) as Orbit | null;
  const cargo = useRef<Mesh>(null);
  const poses = useRef<PoseNow>(poseAt(trial, 0));
  const followed = useRef<Vector3 | null>(null);
  const first = machine.parts.find((part) => part.id === trial.blockIds[0]);
  useEffect(() => {
    invalidate();
  }, [shown, playing, follow, invalidate]);
  useEffect(() => {
    if (!follow) followed.current = null;
  }, [follow]);
  // Before the parts are placed, so that all of a frame is of one instant.
  useFrame(() => {
    poses.current = poseAt(trial, time.current);
    if (cargo.current !== null) {
      cargo.current.matrix.copy(cargoAt(trial, time.current, new Matrix4()));
      cargo.current.matrixWorldNeedsUpdate = true;
    }
    if (follow && first !== undefined && controls !== null) {
      const now = new Vector3().setFromMatrixPosition(poses.current(first, new Matrix4()));
      if (followed.current !== null) {
        const moved = now.clone().sub(followed.current);
        camera.position.add(moved);
        controls.target.add(moved);
        controls.update();
      }
      followed.current = now;
    }
    if (playing) invalidate();
  }, -1);
  const pose = useMemo<PoseNow>(() => (part, into) => poses.current(part, into), []);
  return (
    <>
      <Parts machine={machine} pose={pose} moving colour={colour} />
      {trial.cargo !== null && (
        <mesh ref={cargo} matrixAutoUpdate={false} frustumCulled={false}>
          <boxGeometry args={[...trial.cargo.size]} />
          <meshStandardMaterial color="#859966" roughness={0.8} transparent opacity={0.85} />
        </mesh>
      )}
    </>
  );
}
