import { useMemo } from "react";
import { DoubleSide } from "three";
import { Ground } from "./Ground";
import type { Vector } from "./modules";
import type { CargoShape } from "./trial";
import { lineStrip, markAt, posts, type Gate, type GroundLine, type Mark, turnOf } from "./signs";

export interface Scenario {
  duration_s: number;
  terrain: { center: Vector; size: Vector; slope_deg?: number; heading_deg?: number }[];
  cargo: {
    size: Vector;
    shape?: CargoShape;
    drop_height: number;
    final_mass: number;
    at?: Vector | null;
    heading_deg?: number;
  } | null;
  placement: { kind: string; gap?: number; lowest_center?: number; height?: number; velocity?: Vector };
  gates?: Gate[];
  marks?: Mark[];
  line?: GroundLine | null;
  /** A ball in place of flat ground, straight below. */
  planet?: { radius: number } | null;
}

const POST = 2;
const FLAT = 0.03;

/** A line on the ground, as a flat strip. */
function Strip({ line }: { line: GroundLine }) {
  const [corners, faces] = useMemo(() => {
    const strip = lineStrip(line);
    const next = (k: number, by: number) => (k + by) % strip.length;
    const pairs = Array.from({ length: strip.length / 2 }, (_, k) => 2 * k);
    return [
      new Float32Array(strip.flat()),
      new Uint16Array(pairs.flatMap((k) => [k, next(k, 2), next(k, 1), next(k, 1), next(k, 2), next(k, 3)])),
    ];
  }, [line]);
  return (
    <mesh position={[0, 0, FLAT / 2]}>
      <bufferGeometry>
        <bufferAttribute attach="attributes-position" args={[corners, 3]} />
        <bufferAttribute attach="index" args={[faces, 1]} />
      </bufferGeometry>
      <meshBasicMaterial color="#1c1917" side={DoubleSide} />
    </mesh>
  );
}

/** What is shown and nothing can touch: gates to be crossed, places, and a line. */
function Signs({ scenario, time }: { scenario: Scenario; time: number }) {
  return (
    <>
      {scenario.line != null && <Strip line={scenario.line} />}
      {(scenario.gates ?? []).flatMap((gate) =>
        posts(gate).map(([x, y], side) => (
          <mesh key={`${gate.name} ${side}`} position={[x, y, POST / 2]} rotation={[Math.PI / 2, 0, 0]}>
            <cylinderGeometry args={[0.08, 0.08, POST, 12]} />
            <meshLambertMaterial color={side === 0 ? "#c2410c" : "#1d4ed8"} />
          </mesh>
        )),
      )}
      {(scenario.marks ?? []).map((mark) => {
        const [x, y, z] = markAt(mark, time);
        return (
          <mesh key={mark.name} position={[x, y, z + FLAT]}>
            <ringGeometry args={[Math.max(0, mark.radius - 0.1), mark.radius, 48]} />
            <meshBasicMaterial color="#c2410c" side={DoubleSide} />
          </mesh>
        );
      })}
    </>
  );
}

interface SurroundingsProps {
  scenario: Scenario | null;
  floor?: number;
  /** Seconds of the trial: some marks move. */
  time?: number;
}

/** The ground, the fixed boxes, the gates, the marks and the line of a scenario. */
export function Surroundings({ scenario, floor = 0, time = 0 }: SurroundingsProps) {
  const terrain = useMemo(() => scenario?.terrain ?? [], [scenario]);
  return (
    <>
      <Ground height={floor} />
      {terrain.map((box, index) => (
        <mesh key={index} position={[...box.center]} rotation={turnOf(box)} castShadow receiveShadow>
          <boxGeometry args={[...box.size]} />
          <meshLambertMaterial color="#9aa38b" />
        </mesh>
      ))}
      {scenario !== null && <Signs scenario={scenario} time={time} />}
    </>
  );
}
