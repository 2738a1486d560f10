import type { Vector } from "./modules";

interface Level {
  center: Vector;
  size: Vector;
  slope_deg?: number;
  heading_deg?: number;
}

/** How far above the ground a thing throws a shadow, units. */
export const FARTHEST = 6;

/** The height of what is level and straight below a point: the ground, or the top of a box. */
export function floorUnder(x: number, y: number, z: number, terrain: readonly Level[], ground: number): number {
  let height = ground;
  for (const { center, size, slope_deg = 0, heading_deg = 0 } of terrain) {
    if (slope_deg !== 0 || heading_deg !== 0) continue;
    const top = center[2] + size[2] / 2;
    const inside = Math.abs(x - center[0]) <= size[0] / 2 && Math.abs(y - center[1]) <= size[1] / 2;
    if (inside && top <= z && top > height) height = top;
  }
  return height;
}

/** How strong a shadow is of something so far above where it falls, 0 to 1. */
export function shade(above: number): number {
  return Math.max(0, 1 - Math.max(0, above) / FARTHEST) ** 2;
}
