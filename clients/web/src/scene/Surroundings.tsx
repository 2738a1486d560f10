import { useFrame } from "@react-three/fiber";
import { useMemo, useRef } from "react";
import type { Group } from "three";
import type { Vector } from "./modules";

export interface Scenario {
  duration_s: number;
  terrain: { center: Vector; size: Vector; slope_deg?: number }[];
  cargo: { size: Vector; drop_height: number; final_mass: number } | null;
  placement: { kind: string; gap?: number; lowest_center?: number };
}

const GROUND = 160;
const CELL = 4;

/** The ground around the camera: it has no end, and its lines stay where they are. */
function Ground({ height }: { height: number }) {
  const drawn = useRef<Group>(null);
  useFrame(({ camera }) => {
    const [x, y] = [camera.position.x, camera.position.y].map((at) => CELL * Math.round(at / CELL));
    drawn.current?.position.set(x ?? 0, y ?? 0, height);
  });
  return (
    <group ref={drawn} position={[0, 0, height]}>
      <mesh position={[0, 0, -0.02]}>
        <planeGeometry args={[GROUND, GROUND]} />
        <meshLambertMaterial color="#b9b5a8" transparent opacity={0.55} />
      </mesh>
      <gridHelper args={[GROUND, GROUND / CELL, "#8f8b80", "#8f8b80"]} rotation={[Math.PI / 2, 0, 0]} />
    </group>
  );
}

/** The ground and the fixed boxes of a scenario. */
export function Surroundings({ scenario, floor = 0 }: { scenario: Scenario | null; floor?: number }) {
  const terrain = useMemo(() => scenario?.terrain ?? [], [scenario]);
  return (
    <>
      <Ground height={floor} />
      {terrain.map((box, index) => (
        <mesh key={index} position={[...box.center]} rotation={[((box.slope_deg ?? 0) * Math.PI) / 180, 0, 0]}>
          <boxGeometry args={[...box.size]} />
          <meshLambertMaterial color="#9aa38b" />
        </mesh>
      ))}
    </>
  );
}
