import type { Vector } from "./modules";

/** A place that nothing can touch; one with a drift swings about its centre. */
export interface Mark {
  name: string;
  center: Vector;
  radius: number;
  drift?: { swing: Vector; period_s: Vector } | null;
}

/** Where a mark is at a time of the trial, in seconds. */
export function markAt({ center, drift }: Mark, time: number): Vector {
  if (drift == null) return center;
  const at = (axis: 0 | 1 | 2): number =>
    center[axis] + drift.swing[axis] * Math.sin((2 * Math.PI * time) / drift.period_s[axis]);
  return [at(0), at(1), at(2)];
}

/** A line on the ground to be crossed; nothing can touch it. */
export interface Gate {
  name: string;
  center: readonly [number, number];
  half_width: number;
  heading_deg?: number;
}

/** Where a gate's two posts stand: the line between them lies across the way it is crossed. */
export function posts({ center, half_width, heading_deg = 0 }: Gate): [Vector, Vector] {
  const heading = (heading_deg * Math.PI) / 180;
  const at = (sign: number): Vector => [
    center[0] + sign * half_width * Math.cos(heading),
    center[1] - sign * half_width * Math.sin(heading),
    0,
  ];
  return [at(-1), at(1)];
}
