import { useFrame, useThree } from "@react-three/fiber";
import { useEffect, useMemo, useRef, type RefObject } from "react";
import { Color, Matrix4, Quaternion, Vector3, type InstancedMesh } from "three";
import { moduleGeometry } from "./geometry";
import type { Machine, Part, Rod } from "./machine";
import { KIND_COLOURS, moduleShape } from "./modules";

const ROD_RADIUS = 0.06;
const CHOSEN = new Color("#ff3d8b");
const Y = new Vector3(0, 1, 0);
const WITH_UV = { USE_UV: "" };

/** Darkens a solid's edges by a line, so that blocks in a row are seen one by one, and wheels turn. */
function seamed(shader: { fragmentShader: string }): void {
  shader.fragmentShader = shader.fragmentShader.replace(
    "#include <color_fragment>",
    `#include <color_fragment>
    vec2 pixels = min(vUv, 1.0 - vUv) / fwidth(vUv);
    diffuseColor.rgb *= mix(0.6, 1.0, clamp(min(pixels.x, pixels.y) - 0.3, 0.0, 1.0));`,
  );
}

/** Where a part is now; the pose at the origin of its frame. */
export type PoseNow = (part: Part, into: Matrix4) => Matrix4;

export const asPlaced: PoseNow = (part, into) => into.copy(part.pose);

/** Where a part was clicked, and the way its surface looks there; world frame. */
export interface Hit {
  point: Vector3;
  normal: Vector3;
}

interface PartsProps {
  machine: Machine;
  pose: PoseNow;
  /** Whether poses change from frame to frame. */
  moving?: boolean;
  chosen?: ReadonlySet<string>;
  onChoose?: (id: string, hit?: Hit) => void;
}

/** All blocks of a machine, one instanced mesh a module, and its connectors. */
export function Parts(props: PartsProps) {
  const groups = useMemo(() => {
    const found = new Map<string, Part[]>();
    for (const part of props.machine.parts) found.set(part.module, [...(found.get(part.module) ?? []), part]);
    return [...found];
  }, [props.machine]);
  return (
    <>
      {groups.map(([module, parts]) => (
        <Blocks key={module} module={module} parts={parts} {...props} />
      ))}
      <Rods {...props} />
    </>
  );
}

/** A mesh of as many instances, placed at every frame while they move. */
function useInstances(
  count: number,
  moving: boolean | undefined,
  poseOf: (index: number) => Matrix4,
  colourOf: (index: number) => Color,
): RefObject<InstancedMesh | null> {
  const mesh = useRef<InstancedMesh>(null);
  const invalidate = useThree((state) => state.invalidate);
  const place = (): void => {
    for (let index = 0; index < count; index += 1) mesh.current?.setMatrixAt(index, poseOf(index));
    if (mesh.current !== null) mesh.current.instanceMatrix.needsUpdate = true;
  };
  useEffect(() => {
    place();
    mesh.current?.computeBoundingSphere();
    for (let index = 0; index < count; index += 1) mesh.current?.setColorAt(index, colourOf(index));
    if (mesh.current?.instanceColor) mesh.current.instanceColor.needsUpdate = true;
    invalidate();
  });
  useFrame(() => {
    if (moving) place();
  });
  return mesh;
}

function Blocks({ module, parts, pose, moving, chosen, onChoose }: PartsProps & { module: string; parts: Part[] }) {
  const geometry = moduleGeometry(module);
  const ids = useMemo(() => parts.map((part) => part.id), [parts]);
  const usual = new Color(KIND_COLOURS[moduleShape(module).kind] ?? "#999999");
  const into = new Matrix4();
  const mesh = useInstances(
    parts.length,
    moving,
    (index) => pose(parts[index] as Part, into),
    (index) => (chosen?.has(ids[index] ?? "") ? CHOSEN : usual),
  );
  return (
    <instancedMesh
      key={parts.length}
      ref={mesh}
      args={[geometry, undefined, parts.length]}
      frustumCulled={false}
      castShadow
      receiveShadow
      userData={{ blocks: ids }}
      onClick={(event) => {
        event.stopPropagation();
        const part = event.instanceId === undefined ? undefined : parts[event.instanceId];
        if (part === undefined) return;
        const normal = event.face?.normal.clone().transformDirection(part.pose);
        onChoose?.(part.id, normal === undefined ? undefined : { point: event.point, normal });
      }}
    >
      <meshLambertMaterial defines={WITH_UV} onBeforeCompile={seamed} />
    </instancedMesh>
  );
}

function Rods({ machine, pose, moving, chosen, onChoose }: PartsProps) {
  const parts = useMemo(() => new Map(machine.parts.map((part) => [part.id, part])), [machine]);
  const ids = useMemo(() => machine.rods.map((rod) => rod.id), [machine]);
  const usual = new Color(KIND_COLOURS.connector);
  const block = new Matrix4();
  const at = (id: string | null, local: Vector3): Vector3 => {
    const part = id === null ? undefined : parts.get(id);
    return part === undefined ? local.clone() : local.clone().applyMatrix4(pose(part, block));
  };
  const mesh = useInstances(
    machine.rods.length,
    moving,
    (index) => {
      const rod = machine.rods[index] as Rod;
      return between(at(rod.startBlock, rod.startLocal), at(rod.endBlock, rod.endLocal));
    },
    (index) => (chosen?.has(ids[index] ?? "") ? CHOSEN : usual),
  );
  if (machine.rods.length === 0) return null;
  return (
    <instancedMesh
      key={machine.rods.length}
      ref={mesh}
      args={[undefined, undefined, machine.rods.length]}
      frustumCulled={false}
      castShadow
      receiveShadow
      userData={{ rods: ids }}
      onClick={(event) => {
        event.stopPropagation();
        const rod = event.instanceId === undefined ? undefined : machine.rods[event.instanceId];
        if (rod !== undefined) onChoose?.(rod.id);
      }}
    >
      <cylinderGeometry args={[ROD_RADIUS, ROD_RADIUS, 1, 8]} />
      <meshLambertMaterial />
    </instancedMesh>
  );
}

/** A rod of length 1 along y, stretched from one point to another. */
function between(start: Vector3, end: Vector3): Matrix4 {
  const along = end.clone().sub(start);
  const length = Math.max(1e-6, along.length());
  const turn = new Quaternion().setFromUnitVectors(Y, along.divideScalar(length));
  return new Matrix4().compose(start.add(end).multiplyScalar(0.5), turn, new Vector3(1, length, 1));
}
