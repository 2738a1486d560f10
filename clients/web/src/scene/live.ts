import type { MachineScene } from "./machine";
import type { Scenario } from "./Surroundings";
import type { Trial } from "./trial";

/** Where everything of a drive is: a trial of two instants, the last two that came. */
export interface Live {
  trial: Trial;
  /** When the last one came, by the page's clock, ms. */
  arrived: number;
  /** Seconds of the trial. */
  time: number;
}

const HEAD_BYTES = 8;
const ROW = 7;
/** How long the machine takes from one instant to the next, ms. */
export const TICK_MS = 40;

export function liveOf(scene: { scenario: Scenario; machine: MachineScene | null }): Live {
  const blocks = scene.machine?.blocks ?? [];
  const cargo = scene.scenario.cargo;
  return {
    arrived: 0,
    time: 0,
    trial: {
      times: Float64Array.of(0, 1),
      blockIds: blocks.map((block) => block.id),
      positions: new Float32Array(2 * 3 * blocks.length),
      quaternions: new Float32Array(2 * 4 * blocks.length),
      cargo:
        cargo === null
          ? null
          : {
              size: cargo.size,
              shape: cargo.shape ?? "box",
              positions: new Float32Array(6),
              quaternions: new Float32Array(8),
              mass: new Float64Array(2),
            },
      peaks: [],
      loads: null,
      breaks: [],
      piloting: null,
      engine: "",
      engineVersion: "",
    },
  };
}

/** Writes rows of (x, y, z, w, x, y, z) behind what came before. */
function follow(positions: Float32Array, quaternions: Float32Array, rows: Float32Array, isFirst: boolean): void {
  const count = rows.length / ROW;
  positions.copyWithin(0, 3 * count);
  quaternions.copyWithin(0, 4 * count);
  for (let item = 0; item < count; item += 1) {
    positions.set(rows.subarray(ROW * item, ROW * item + 3), 3 * (count + item));
    quaternions.set(rows.subarray(ROW * item + 3, ROW * item + ROW), 4 * (count + item));
  }
  if (isFirst) {
    positions.copyWithin(0, 3 * count);
    quaternions.copyWithin(0, 4 * count);
  }
}

/** Takes a frame in, as the service sends it. */
export function takeFrame(live: Live, frame: ArrayBuffer, now: number): void {
  const { trial } = live;
  const rows = new Float32Array(frame, HEAD_BYTES);
  const blocks = ROW * trial.blockIds.length;
  const isFirst = live.arrived === 0;
  follow(trial.positions, trial.quaternions, rows.subarray(0, blocks), isFirst);
  if (trial.cargo !== null) follow(trial.cargo.positions, trial.cargo.quaternions, rows.subarray(blocks), isFirst);
  live.time = new DataView(frame).getFloat32(0, true);
  live.arrived = now;
}

/** Height, and speed over the ground, of the first block now. */
export function motionOf({ trial }: Live): { height: number; speed: number } {
  const [at, before] = [3 * trial.blockIds.length, 0];
  const moved = [0, 1, 2].map((axis) => (trial.positions[at + axis] ?? 0) - (trial.positions[before + axis] ?? 0));
  return { height: trial.positions[at + 2] ?? 0, speed: Math.hypot(...moved) / (TICK_MS / 1000) };
}
