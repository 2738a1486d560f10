import { useFrame, useThree } from "@react-three/fiber";
import { useEffect, useMemo, useRef } from "react";
import { Color, Matrix4, Quaternion, Vector3, type InstancedMesh } from "three";
import { jointsOf, loadColour, shownSize } from "./loads";
import type { Machine } from "./machine";
import type { PoseNow } from "./Parts";
import type { Trial } from "./trial";

const BROKEN = 0.3;
const UPRIGHT = new Quaternion();

/** A ball at each joint with a high load, the larger and redder the nearer to breaking. */
export function LoadedJoints({
  machine,
  trial,
  pose,
  loads,
}: {
  machine: Machine;
  trial: Trial;
  pose: PoseNow;
  loads: Float32Array;
}) {
  const mesh = useRef<InstancedMesh>(null);
  const invalidate = useThree((state) => state.invalidate);
  const joints = useMemo(() => placed(machine, trial), [machine, trial]);
  const place = (): void => {
    const [at, into] = [new Vector3(), new Matrix4()];
    joints.forEach(({ index, part }, item) => {
      at.setFromMatrixPosition(pose(part, into));
      const size = Math.max(1e-4, shownSize(loads[index] ?? 0));
      mesh.current?.setMatrixAt(item, into.compose(at, UPRIGHT, new Vector3(size, size, size)));
    });
    if (mesh.current !== null) mesh.current.instanceMatrix.needsUpdate = true;
  };
  useEffect(() => {
    joints.forEach(({ index }, item) => mesh.current?.setColorAt(item, new Color(loadColour(loads[index] ?? 0))));
    if (mesh.current?.instanceColor) mesh.current.instanceColor.needsUpdate = true;
    invalidate();
  }, [joints, loads, invalidate]);
  useFrame(place);
  if (joints.length === 0) return null;
  return (
    // Drawn over the blocks: joints lie inside them.
    <instancedMesh ref={mesh} args={[undefined, undefined, joints.length]} frustumCulled={false} renderOrder={2}>
      <sphereGeometry args={[1, 10, 6]} />
      <meshBasicMaterial depthTest={false} transparent opacity={0.9} />
    </instancedMesh>
  );
}

/** A crossed-out place for each joint that broke up to now. */
export function Breaks({ machine, trial, pose, now }: { machine: Machine; trial: Trial; pose: PoseNow; now: number }) {
  const mesh = useRef<InstancedMesh>(null);
  const joints = useMemo(() => {
    const broken = new Map(trial.breaks.map((event) => [event.joint, event.time_s]));
    return placed(machine, trial).flatMap((joint) => {
      const time = broken.get(joint.name);
      return time === undefined ? [] : [{ ...joint, time }];
    });
  }, [machine, trial]);
  useFrame(() => {
    const [at, into] = [new Vector3(), new Matrix4()];
    joints.forEach(({ part, time }, item) => {
      at.setFromMatrixPosition(pose(part, into));
      const size = time <= now ? BROKEN : 1e-4;
      mesh.current?.setMatrixAt(item, into.compose(at, UPRIGHT, new Vector3(size, size, size)));
    });
    if (mesh.current !== null) mesh.current.instanceMatrix.needsUpdate = true;
  });
  if (joints.length === 0) return null;
  return (
    <instancedMesh
      ref={mesh}
      args={[undefined, undefined, joints.length]}
      frustumCulled={false}
      renderOrder={3}
      userData={{ breaks: joints.map((joint) => joint.name) }}
    >
      <octahedronGeometry args={[1]} />
      <meshBasicMaterial color="#b00020" wireframe depthTest={false} transparent />
    </instancedMesh>
  );
}

function placed(machine: Machine, trial: Trial) {
  const parts = new Map(machine.parts.map((part) => [part.id, part]));
  return jointsOf(trial).flatMap((joint) => {
    const part = joint.block === null ? undefined : parts.get(joint.block);
    return part === undefined ? [] : [{ ...joint, part }];
  });
}
