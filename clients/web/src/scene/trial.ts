import { Table, tableFromIPC } from "apache-arrow";

export interface JointPeak {
  joint: string;
  kind: string;
  force: number;
  moment: number;
  ratio: number;
}

export interface Break {
  time_s: number;
  joint: string;
  kind: string;
  ratio: number;
}

/** A ball's size is its diameter three times. */
export type CargoShape = "box" | "ball";

/** A rollout: T instants, N tracked blocks, J joints. */
export interface Trial {
  times: Float64Array;
  blockIds: readonly string[];
  /** T x N x 3: the points shown as the blocks' positions, world frame, units. */
  positions: Float32Array;
  /** T x N x 4 as (w, x, y, z). */
  quaternions: Float32Array;
  cargo: {
    size: readonly [number, number, number];
    shape: CargoShape;
    positions: Float32Array;
    quaternions: Float32Array;
    mass: Float64Array;
  } | null;
  peaks: readonly JointPeak[];
  /** T x J shares of strength, in the order of the peaks; null in older trajectories. */
  loads: Float32Array | null;
  breaks: readonly Break[];
  engine: string;
  engineVersion: string;
}

interface Facts {
  block_ids: string[];
  cargo_size: [number, number, number] | null;
  cargo_shape?: CargoShape;
  joint_peaks: JointPeak[];
  breaks: Break[];
  engine: string;
  engine_version: string;
}

export const ARROW = "application/vnd.apache.arrow.stream";
const FACTS = "buildarena.trajectory";

/** A column of fixed-size lists as one flat array; null where the trajectory has none. */
function flat(table: Table, name: string): Float32Array | null {
  const data = table.getChild(name)?.data ?? [];
  const parts = data.map((chunk) => chunk.children[0]?.values as Float32Array);
  if (parts.length <= 1) return parts[0] ?? null;
  const whole = new Float32Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}

function series(table: Table, name: string): Float64Array | null {
  const column = table.getChild(name);
  return column === null ? null : Float64Array.from(column as Iterable<number>);
}

const NONE = new Float32Array();

/** Reads a trajectory as the service sends it, an Arrow stream. */
export function readTrial(file: ArrayBuffer): Trial {
  const table = tableFromIPC(new Uint8Array(file));
  const text = table.schema.metadata.get(FACTS);
  if (text === undefined) throw new Error("this file is not a trajectory");
  const facts = JSON.parse(text) as Facts;
  const times = series(table, "time_s") ?? new Float64Array();
  const size = facts.cargo_size;
  return {
    times,
    blockIds: facts.block_ids,
    positions: flat(table, "positions") ?? NONE,
    quaternions: flat(table, "quaternions") ?? NONE,
    cargo:
      size === null
        ? null
        : {
            size,
            shape: facts.cargo_shape ?? "box",
            positions: flat(table, "cargo_position") ?? NONE,
            quaternions: flat(table, "cargo_quaternion") ?? NONE,
            mass: series(table, "cargo_mass") ?? new Float64Array(times.length),
          },
    peaks: facts.joint_peaks,
    loads: flat(table, "joint_loads"),
    breaks: facts.breaks,
    engine: facts.engine,
    engineVersion: facts.engine_version,
  };
}

/** The last instant at or before a time, and how far the next one is on. */
export function instantAt(times: Float64Array, time: number): { index: number; share: number } {
  const last = times.length - 1;
  if (last < 1 || time <= (times[0] ?? 0)) return { index: 0, share: 0 };
  if (time >= (times[last] ?? 0)) return { index: last, share: 0 };
  let low = 0;
  let high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if ((times[middle] ?? 0) <= time) low = middle;
    else high = middle;
  }
  const from = times[low] ?? 0;
  const to = times[high] ?? from;
  return { index: low, share: to > from ? (time - from) / (to - from) : 0 };
}
