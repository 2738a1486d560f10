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

/** The load on every joint at a time, as a share of its strength; its largest where no series was kept. */
export function loadsAt(trial: Trial, time: number): Float32Array {
  const count = trial.peaks.length;
  if (trial.loads === null) return Float32Array.from(trial.peaks, (peak) => peak.ratio);
  // The load up to an instant is stored with it, so the next one covers the time between.
  const { index, share } = instantAt(trial.times, time);
  const row = Math.min(trial.times.length - 1, share > 0 ? index + 1 : index);
  return trial.loads.subarray(row * count, (row + 1) * count);
}

/** The joint with the highest load, if any has one. */
export function mostLoaded(trial: Trial, loads: Float32Array): { joint: string; kind: string; ratio: number } | null {
  let found = -1;
  loads.forEach((load, index) => {
    if (load > (loads[found] ?? 0)) found = index;
  });
  const peak = trial.peaks[found];
  return peak === undefined ? null : { joint: peak.joint, kind: peak.kind, ratio: loads[found] ?? 0 };
}

/** The highest load on the joints of a part in a trial, as a share of their strength. */
export function mostOf(trial: Trial, part: string, rod: string | undefined): number {
  const own = trial.peaks.filter(({ joint }) => joint === rod || joint.split("-").includes(part));
  return Math.max(0, ...own.map(({ ratio }) => ratio));
}

/** From which share of its strength a joint is worth a look. */
export const WORTH_SHOWING = 0.5;

/** From yellow at half of a joint's strength to red where it breaks. */
export function loadColour(ratio: number): string {
  const share = Math.min(1, Math.max(0, (ratio - WORTH_SHOWING) / (1 - WORTH_SHOWING)));
  const [red, green] = [236 - 22 * share, 190 - 150 * share].map(Math.round);
  return `rgb(${red}, ${green}, 50)`;
}

/** The radius of the ball that shows a joint's load, units; none below what is worth a look. */
export function shownSize(ratio: number): number {
  return ratio > WORTH_SHOWING ? 0.34 * Math.min(1, ratio) : 0;
}
