import type { BenchPart, Place } from "./session";

const NEAR = 1e-3;

const alike = (a: readonly number[], b: readonly number[]): boolean =>
  a.every((value, axis) => Math.abs(value - (b[axis] ?? NaN)) < NEAR);
const across = ([x = 0, ...rest]: readonly number[]): number[] => [-x, ...rest];

/** The free face on the other side of the plane between east and west; none where a face is its own. */
export function mirrored(parts: readonly BenchPart[], place: Place): Place | undefined {
  const face = parts.find(({ id }) => id === place.part)?.faces.find(({ label }) => label === place.face);
  if (face === undefined) return undefined;
  for (const part of parts) {
    for (const other of part.faces) {
      const is = alike(other.center, across(face.center)) && alike(other.normal, across(face.normal));
      if (is && other !== face && other.taken_by === null) return { part: part.id, face: other.label };
    }
  }
  return undefined;
}
