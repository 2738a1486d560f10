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

/** Positions of a gate's two posts: the line between them lies across the way it is crossed. */
export function posts({ center, half_width, heading_deg = 0 }: Gate): [Vector, Vector] {
  const heading = (heading_deg * Math.PI) / 180;
  const at = (sign: number): Vector => [
    center[0] + sign * half_width * Math.cos(heading),
    center[1] - sign * half_width * Math.sin(heading),
    0,
  ];
  return [at(-1), at(1)];
}

/** A closed line on the ground, which begins at the origin towards the north: a circle with waves. */
export interface GroundLine {
  radius: number;
  bends?: readonly (readonly [number, number])[];
  side?: number;
  half_width?: number;
}

/** Points along a line, the first at the origin, at even angles about its centre. */
export function linePoints({ radius, bends = [], side = 1 }: GroundLine, count = 240): [number, number][] {
  const away = (angle: number): number =>
    radius * bends.reduce((sum, [c, s], k) => sum + c * Math.cos((k + 2) * angle) + s * Math.sin((k + 2) * angle), 1);
  const slope = radius * bends.reduce((sum, [, s], k) => sum + (k + 2) * s, 0);
  const turn = Math.PI / 2 - Math.atan2(away(0), slope);
  return Array.from({ length: count }, (_, step) => {
    const angle = (2 * Math.PI * step) / count;
    const [x, y] = [away(angle) * Math.cos(angle) - away(0), away(angle) * Math.sin(angle)];
    const east = x * Math.cos(turn) - y * Math.sin(turn);
    return [side < 0 ? -east : east, x * Math.sin(turn) + y * Math.cos(turn)];
  });
}

/** Both edges of a line, as corners of a strip: of each point the right one, then the left one. */
export function lineStrip(line: GroundLine): Vector[] {
  const points = linePoints(line);
  const at = (k: number) => points[(k + points.length) % points.length] ?? [0, 0];
  return points.flatMap(([x, y], k) => {
    const [ahead, behind] = [at(k + 1), at(k - 1)];
    const [dx, dy] = [ahead[0] - behind[0], ahead[1] - behind[1]];
    const half = (line.half_width ?? 0.5) / Math.hypot(dx, dy);
    return [
      [x + dy * half, y - dx * half, 0],
      [x - dy * half, y + dx * half, 0],
    ] as Vector[];
  });
}

/** Orientation of a box: tilted about the east-west axis, then turned about the vertical, from north towards east. */
export function turnOf(box: { slope_deg?: number; heading_deg?: number }): [number, number, number, "ZXY"] {
  return [((box.slope_deg ?? 0) * Math.PI) / 180, 0, (-(box.heading_deg ?? 0) * Math.PI) / 180, "ZXY"];
}
