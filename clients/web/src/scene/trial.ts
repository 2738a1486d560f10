import { decompress } from "fzstd";
import { parquetMetadata, parquetReadObjects } from "hyparquet";

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

/** A rollout: T instants, N tracked blocks. */
export interface Trial {
  times: Float64Array;
  blockIds: readonly string[];
  /** T x N x 3: the points shown as the blocks' positions, world frame, units. */
  positions: Float32Array;
  /** T x N x 4 as (w, x, y, z). */
  quaternions: Float32Array;
  cargo: { size: readonly [number, number, number]; positions: Float32Array; quaternions: Float32Array; mass: Float64Array } | null;
  peaks: readonly JointPeak[];
  breaks: readonly Break[];
  engine: string;
  engineVersion: string;
}

interface Facts {
  block_ids: string[];
  cargo_size: [number, number, number] | null;
  joint_peaks: JointPeak[];
  breaks: Break[];
  engine: string;
  engine_version: string;
}

interface SampleRow {
  time_s: number;
  positions: number[];
  quaternions: number[];
  cargo_position?: number[];
  cargo_quaternion?: number[];
  cargo_mass?: number;
}

const FACTS = "buildarena.trajectory";
const WANTED = ["time_s", "positions", "quaternions", "cargo_position", "cargo_quaternion", "cargo_mass"];

function flat(rows: readonly number[][]): Float32Array {
  const width = rows[0]?.length ?? 0;
  const values = new Float32Array(rows.length * width);
  rows.forEach((row, index) => {
    values.set(row, index * width);
  });
  return values;
}

/** Reads a trajectory as the service keeps it. */
export async function readTrial(file: ArrayBuffer): Promise<Trial> {
  const metadata = parquetMetadata(file);
  const text = metadata.key_value_metadata?.find((entry) => entry.key === FACTS)?.value;
  if (text === undefined) throw new Error("this file is no trajectory");
  const facts = JSON.parse(text) as Facts;
  const present = new Set(metadata.schema.map((element) => element.name));
  const rows = (await parquetReadObjects({
    file,
    metadata,
    columns: WANTED.filter((name) => present.has(name)),
    compressors: { ZSTD: (input, length) => decompress(input, new Uint8Array(length)) },
  })) as unknown as SampleRow[];
  const size = facts.cargo_size;
  return {
    times: Float64Array.from(rows, (row) => row.time_s),
    blockIds: facts.block_ids,
    positions: flat(rows.map((row) => row.positions)),
    quaternions: flat(rows.map((row) => row.quaternions)),
    cargo:
      size === null
        ? null
        : {
            size,
            positions: flat(rows.map((row) => row.cargo_position ?? [0, 0, 0])),
            quaternions: flat(rows.map((row) => row.cargo_quaternion ?? [1, 0, 0, 0])),
            mass: Float64Array.from(rows, (row) => row.cargo_mass ?? 0),
          },
    peaks: facts.joint_peaks,
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

export interface Curve {
  name: string;
  unit: string;
  values: Float64Array;
}

function distances(positions: Float32Array, stride: number, count: number): Float64Array {
  const [x, y] = [positions[0] ?? 0, positions[1] ?? 0];
  return Float64Array.from({ length: count }, (_, i) =>
    Math.hypot((positions[i * stride] ?? 0) - x, (positions[i * stride + 1] ?? 0) - y),
  );
}

/** What a trial is judged by, over time: heights, distances, the load. */
export function curvesOf(trial: Trial): Curve[] {
  const count = trial.times.length;
  const stride = trial.blockIds.length * 3;
  const height = Float64Array.from({ length: count }, (_, i) => {
    let sum = 0;
    for (let block = 0; block < trial.blockIds.length; block += 1) sum += trial.positions[i * stride + block * 3 + 2] ?? 0;
    return sum / Math.max(1, trial.blockIds.length);
  });
  const curves: Curve[] = [
    { name: "Mean height of the machine", unit: "units", values: height },
    { name: "Distance of the starting block", unit: "units", values: distances(trial.positions, stride, count) },
  ];
  if (trial.cargo !== null) {
    curves.push({ name: "Distance of the cargo", unit: "units", values: distances(trial.cargo.positions, 3, count) });
    curves.push({ name: "Mass of the cargo", unit: "mass units", values: trial.cargo.mass });
  }
  return curves;
}
