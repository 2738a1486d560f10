import { Quaternion, Vector3 } from "three";
import type { Scenario } from "./Surroundings";
import type { Trial } from "./trial";

const UP = new Vector3(0, 0, 1);
const seen = new WeakMap<Trial, Trial>();

function from(values: Float32Array, at: number): Vector3 {
  return new Vector3(values[at], values[at + 1], values[at + 2]);
}

/**
 * A trial as seen by a passenger: the ground of a planet is unrolled below the first block, so that it
 * is level and flat, and rolls by as fast as it does. A trial on flat ground is itself.
 */
export function seenAlong(trial: Trial, scenario: Scenario): Trial {
  const radius = scenario.planet?.radius;
  const blocks = trial.blockIds.length;
  if (radius === undefined || blocks === 0) return trial;
  const known = seen.get(trial);
  if (known !== undefined) return known;
  const center = new Vector3(0, 0, -radius);
  const [positions, quaternions] = [trial.positions.slice(), trial.quaternions.slice()];
  const level = new Quaternion();
  const place = new Vector3();
  for (let instant = 0; instant < trial.times.length; instant += 1) {
    const first = instant * blocks;
    const up = from(trial.positions, 3 * first)
      .sub(center)
      .normalize();
    const below = up.clone().applyQuaternion(level);
    if (instant > 0) place.add(new Vector3(below.x, below.y, 0).multiplyScalar(radius));
    level.premultiply(new Quaternion().setFromUnitVectors(below, UP)).normalize();
    const foot = up.multiplyScalar(radius).add(center);
    for (let item = first; item < first + blocks; item += 1) {
      from(trial.positions, 3 * item)
        .sub(foot)
        .applyQuaternion(level)
        .add(place)
        .toArray(positions, 3 * item);
      const at = 4 * item;
      const [w, x, y, z] = trial.quaternions.subarray(at, at + 4);
      const turned = new Quaternion(x, y, z, w).premultiply(level);
      quaternions.set([turned.w, turned.x, turned.y, turned.z], at);
    }
  }
  const shown = { ...trial, positions, quaternions };
  seen.set(trial, shown);
  return shown;
}
