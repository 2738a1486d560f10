import { instantAt, type Trial } from "./trial";

/** A joint as it is drawn: where it sits, and how it is called. */
export interface DrawnJoint {
  /** Its place in the trial's list of joints. */
  index: number;
  name: string;
  /** The block at whose root it sits; null for a connector, which is drawn itself. */
  block: string | null;
}

/** The joints of a trial's machine. An attachment "1-2" sits at the root of its second block. */
export function jointsOf(trial: Trial): DrawnJoint[] {
  const known = new Set(trial.blockIds);
  return trial.peaks.map((peak, index) => {
    const second = peak.joint.slice(peak.joint.indexOf("-") + 1);
    return { index, name: peak.joint, block: peak.joint.includes("-") && known.has(second) ? second : null };
  });
}

/** What every joint bears at a time, as a share of its strength; its largest where no series was kept. */
export function loadsAt(trial: Trial, time: number): Float32Array {
  const count = trial.peaks.length;
  if (trial.loads === null) return Float32Array.from(trial.peaks, (peak) => peak.ratio);
  // What was borne up to an instant is told with it, so the next one speaks of the time between.
  const { index, share } = instantAt(trial.times, time);
  const row = Math.min(trial.times.length - 1, share > 0 ? index + 1 : index);
  return trial.loads.subarray(row * count, (row + 1) * count);
}

/** The load at each block: of the joints it is part of, the largest. */
export function loadsOfBlocks(trial: Trial, loads: Float32Array): Map<string, number> {
  const known = new Set(trial.blockIds);
  const worst = new Map<string, number>();
  trial.peaks.forEach((peak, index) => {
    for (const id of peak.joint.split("-").filter((part) => known.has(part))) {
      worst.set(id, Math.max(worst.get(id) ?? 0, loads[index] ?? 0));
    }
  });
  return worst;
}

/** The joint that bears most, if any bears something. */
export function mostLoaded(trial: Trial, loads: Float32Array): { joint: string; kind: string; ratio: number } | null {
  let found = -1;
  loads.forEach((load, index) => {
    if (load > (loads[found] ?? 0)) found = index;
  });
  const peak = trial.peaks[found];
  return peak === undefined ? null : { joint: peak.joint, kind: peak.kind, ratio: loads[found] ?? 0 };
}

/** The most that the joints of a part bear in a trial, as a share of their strength. */
export function mostOf(trial: Trial, part: string, rod: string | undefined): number {
  const own = trial.peaks.filter(({ joint }) => joint === rod || joint.split("-").includes(part));
  return Math.max(0, ...own.map(({ ratio }) => ratio));
}

const STOPS = [
  [0, [120, 140, 165]],
  [0.5, [236, 190, 60]],
  [1, [214, 40, 40]],
] as const;

/** From grey-blue for no load over yellow to red for one that breaks. */
export function loadColour(ratio: number): string {
  const share = Math.min(1, Math.max(0, ratio));
  const upper = STOPS.findIndex(([at]) => share <= at);
  const [to, [r, g, b]] = STOPS[Math.max(1, upper)] ?? STOPS[2];
  const [from, [r0, g0, b0]] = STOPS[Math.max(1, upper) - 1] ?? STOPS[0];
  const part = (share - from) / (to - from);
  const mixed = [r0 + part * (r - r0), g0 + part * (g - g0), b0 + part * (b - b0)].map(Math.round);
  return `rgb(${mixed.join(", ")})`;
}
