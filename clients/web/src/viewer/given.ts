import type { MachineScene } from "../scene/machine";
import type { Scenario } from "../scene/Surroundings";
import type { Break, CargoShape, JointPeak, Trial } from "../scene/trial";

/** A trial as notebooks give it: arrays are little-endian bytes in base64. */
export interface GivenTrial {
  times: string;
  block_ids: string[];
  positions: string;
  quaternions: string;
  cargo: {
    size: [number, number, number];
    shape?: CargoShape;
    positions: string;
    quaternions: string;
    mass: string;
  } | null;
  joint_peaks: (Omit<JointPeak, "ratio"> & { ratio: number | null })[];
  joint_loads: string | null;
  breaks: Break[];
  engine: string;
  engine_version: string;
}

/** What is to be shown: a machine, or a machine in its trial. */
export interface Given {
  title: string;
  /** The heading. */
  heading?: string;
  machine: MachineScene;
  scenario: Scenario | null;
  trial: GivenTrial | null;
}

export function bytesOf(text: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

const floats = (text: string): Float32Array => new Float32Array(bytesOf(text).buffer);
const doubles = (text: string): Float64Array => new Float64Array(bytesOf(text).buffer);

export function trialOf(given: GivenTrial): Trial {
  return {
    times: doubles(given.times),
    blockIds: given.block_ids,
    positions: floats(given.positions),
    quaternions: floats(given.quaternions),
    cargo:
      given.cargo === null
        ? null
        : {
            size: given.cargo.size,
            shape: given.cargo.shape ?? "box",
            positions: floats(given.cargo.positions),
            quaternions: floats(given.cargo.quaternions),
            mass: doubles(given.cargo.mass),
          },
    // A load that is not a number is not a joint's.
    peaks: given.joint_peaks.map((peak) => ({ ...peak, ratio: peak.ratio ?? Infinity })),
    loads: given.joint_loads === null ? null : floats(given.joint_loads),
    breaks: given.breaks,
    engine: given.engine,
    engineVersion: given.engine_version,
  };
}

/** Unpacks what a page carries: JSON, gzipped, in base64. */
export async function readGiven(text: string): Promise<Given> {
  const unpacked = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream("gzip"));
  return (await new Response(unpacked).json()) as Given;
}
