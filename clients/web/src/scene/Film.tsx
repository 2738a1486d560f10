import { useFrame, useThree } from "@react-three/fiber";
import { useEffect, useMemo, useRef } from "react";
import { Matrix4, Vector3, type Mesh } from "three";
import { CargoSolid } from "./CargoSolid";
import type { Clock } from "./clock";
import { Breaks, LoadedJoints } from "./Joints";
import type { Machine } from "./machine";
import { Parts, type PoseNow } from "./Parts";
import { cargoAt, poseAt } from "./playing";
import { Shadows } from "./Shadows";
import type { Scenario } from "./Surroundings";
import type { Trial } from "./trial";

interface Orbit {
  target: Vector3;
  update: () => void;
}

/** The moving things of a trial; frames are drawn while it plays, and when the user seeks. */
export function Film({
  machine,
  trial,
  clock,
  follow,
  loads,
  begins = 0,
  chosen,
  onChoose,
  terrain,
}: {
  machine: Machine;
  trial: Trial;
  clock: Clock;
  follow: boolean;
  /** At which time the machine is where the camera first looks for it. */
  begins?: number;
  /** What shadows fall on. */
  terrain?: Scenario["terrain"];
  /** The part that is pointed out. */
  chosen?: string;
  onChoose?: (part: string | undefined) => void;
  /** The load on each joint; null to show none. */
  loads: Float32Array | null;
}) {
  const { time, shown, playing } = clock;
  const { invalidate, camera } = useThree();
  const controls = useThree((state) => state.controls) as Orbit | null;
  const cargo = useRef<Mesh>(null);
  const poses = useRef(new Map<string, Matrix4>());
  const first = machine.parts.find((part) => part.id === trial.blockIds[0]);
  const followed = useRef<Vector3 | null>(null);
  const unmoved = useRef(true);
  useEffect(() => {
    invalidate();
  }, [shown, playing, follow, invalidate]);
  useEffect(() => {
    if (!follow) followed.current = null;
  }, [follow]);
  // Before the parts are placed, so that all of a frame is of one instant.
  useFrame(() => {
    const now = poseAt(trial, time.current);
    for (const part of machine.parts) {
      const known = poses.current.get(part.id) ?? new Matrix4();
      poses.current.set(part.id, now(part, known));
    }
    if (cargo.current !== null) {
      cargo.current.matrix.copy(cargoAt(trial, time.current, new Matrix4()));
      cargo.current.matrixWorldNeedsUpdate = true;
    }
    if (follow && first !== undefined && controls !== null) {
      const here = new Vector3().setFromMatrixPosition(poses.current.get(first.id) ?? first.pose);
      if (unmoved.current) {
        unmoved.current = false;
        followed.current = new Vector3().setFromMatrixPosition(poseAt(trial, begins)(first, new Matrix4()));
      }
      if (followed.current !== null) {
        const moved = here.clone().sub(followed.current);
        camera.position.add(moved);
        controls.target.add(moved);
        controls.update();
      }
      followed.current = here;
    }
    if (playing) invalidate();
  }, -1);
  const pointed = useMemo(() => new Set(chosen === undefined ? [] : [chosen]), [chosen]);
  const pose = useMemo<PoseNow>(() => (part, into) => into.copy(poses.current.get(part.id) ?? part.pose), []);
  return (
    <>
      <Shadows machine={machine} pose={pose} moving terrain={terrain} />
      <Parts machine={machine} pose={pose} moving chosen={pointed} onChoose={onChoose} />
      {loads !== null && <LoadedJoints machine={machine} trial={trial} pose={pose} loads={loads} />}
      <Breaks machine={machine} trial={trial} pose={pose} now={shown} />
      {trial.cargo !== null && (
        <mesh ref={cargo} matrixAutoUpdate={false} frustumCulled={false} castShadow>
          <CargoSolid size={trial.cargo.size} shape={trial.cargo.shape} />
        </mesh>
      )}
    </>
  );
}
