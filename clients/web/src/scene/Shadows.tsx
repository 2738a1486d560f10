import { useFrame, useThree } from "@react-three/fiber";
import { useEffect, useRef } from "react";
import { CanvasTexture, Matrix4, Quaternion, Vector3, type InstancedMesh } from "three";
import type { Machine } from "./machine";
import type { PoseNow } from "./Parts";
import { floorUnder, shade } from "./shadow";
import type { Scenario } from "./Surroundings";

const LIFT = 0.015;
const SIDE = 1.5;
const PIXELS = 64;
/** The side of the ground on which cast shadows fall, units. */
const FIELD = 4000;
const FLAT = new Quaternion();

let drawnSpot: CanvasTexture | null = null;

/** A soft spot, dark in its middle. */
function spot(): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = PIXELS;
  const context = canvas.getContext("2d");
  if (context !== null) {
    const half = PIXELS / 2;
    const fading = context.createRadialGradient(half, half, 0, half, half, half);
    fading.addColorStop(0, "rgba(20, 18, 14, 0.5)");
    fading.addColorStop(0.55, "rgba(20, 18, 14, 0.28)");
    fading.addColorStop(1, "rgba(20, 18, 14, 0)");
    context.fillStyle = fading;
    context.fillRect(0, 0, PIXELS, PIXELS);
  }
  return new CanvasTexture(canvas);
}

interface ShadowsProps {
  machine: Machine;
  pose: PoseNow;
  moving?: boolean;
  terrain?: Scenario["terrain"];
  ground?: number;
}

/** What shows positions and heights on the ground: cast shadows, or where none are drawn a spot below each block. */
export function Shadows({ machine, pose, moving = false, terrain = [], ground = 0 }: ShadowsProps) {
  const mesh = useRef<InstancedMesh>(null);
  const invalidate = useThree((state) => state.invalidate);
  const casts = useThree((state) => state.gl.shadowMap.enabled);
  const place = (): void => {
    const [at, into, size] = [new Vector3(), new Matrix4(), new Vector3()];
    machine.parts.forEach((part, index) => {
      at.setFromMatrixPosition(pose(part, into));
      const floor = floorUnder(at.x, at.y, at.z, terrain, ground);
      size.setScalar(Math.max(1e-4, SIDE * shade(at.z - floor)));
      mesh.current?.setMatrixAt(index, into.compose(at.setZ(floor + LIFT), FLAT, size));
    });
    if (mesh.current !== null) mesh.current.instanceMatrix.needsUpdate = true;
  };
  useEffect(() => {
    place();
    invalidate();
  });
  useFrame(() => {
    if (moving) place();
  });
  if (casts) {
    return (
      <mesh position={[0, 0, ground + LIFT]} receiveShadow renderOrder={-1} raycast={() => undefined}>
        <planeGeometry args={[FIELD, FIELD]} />
        <shadowMaterial opacity={0.3} depthWrite={false} />
      </mesh>
    );
  }
  if (machine.parts.length === 0) return null;
  return (
    <instancedMesh
      key={machine.parts.length}
      ref={mesh}
      args={[undefined, undefined, machine.parts.length]}
      frustumCulled={false}
      renderOrder={-1}
      raycast={() => undefined}
    >
      <planeGeometry args={[1, 1]} />
      <meshBasicMaterial map={(drawnSpot ??= spot())} transparent depthWrite={false} />
    </instancedMesh>
  );
}
