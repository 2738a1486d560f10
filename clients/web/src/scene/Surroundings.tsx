import { useMemo } from "react";
import type { Vector } from "./modules";

export interface Scenario {
  duration_s: number;
  terrain: { center: Vector; size: Vector; slope_deg?: number }[];
  cargo: { size: Vector; drop_height: number; final_mass: number } | null;
  placement: { kind: string; gap?: number; lowest_center?: number };
}

const GROUND = 160;
const LINES = 80;

/** The ground and the fixed boxes of a scenario. */
export function Surroundings({ scenario, floor = 0 }: { scenario: Scenario | null; floor?: number }) {
  const terrain = useMemo(() => scenario?.terrain ?? [], [scenario]);
  return (
    <>
      <mesh position={[0, 0, floor - 0.02]}>
        <planeGeometry args={[GROUND, GROUND]} />
        <meshLambertMaterial color="#b9b5a8" transparent opacity={0.55} />
      </mesh>
      <gridHelper args={[GROUND, LINES, "#6f6b60", "#8f8b80"]} rotation={[Math.PI / 2, 0, 0]} position={[0, 0, floor]} />
      {terrain.map((box, index) => (
        <mesh key={index} position={[...box.center]} rotation={[((box.slope_deg ?? 0) * Math.PI) / 180, 0, 0]}>
          <boxGeometry args={[...box.size]} />
          <meshLambertMaterial color="#9aa38b" />
        </mesh>
      ))}
    </>
  );
}
