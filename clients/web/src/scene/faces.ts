import { Vector3 } from "three";
import type { Vector } from "./modules";
import type { Hit } from "./Parts";

export interface PlacedFace {
  label: string;
  center: Vector;
  normal: Vector;
}

/** How far off a face's own direction the surface may look that was clicked: 30 degrees. */
const NEAR = 0.86;
/** How far from a face's plane a click still is on it, in units. */
const DEEP = 0.3;

/** The face that was clicked: one that looks the same way, in the same plane, with the nearest centre. */
export function faceAt<Face extends PlacedFace>(faces: readonly Face[], hit: Hit | undefined): Face | undefined {
  if (hit === undefined) return undefined;
  let best: Face | undefined;
  let least = Infinity;
  for (const face of faces) {
    const normal = new Vector3(...face.normal);
    const away = hit.point.clone().sub(new Vector3(...face.center));
    if (normal.dot(hit.normal) < NEAR || Math.abs(away.dot(normal)) > DEEP) continue;
    if (away.lengthSq() < least) {
      least = away.lengthSq();
      best = face;
    }
  }
  return best;
}
