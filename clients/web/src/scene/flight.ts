import { Quaternion, Vector3 } from "three";
import type { Scenario } from "./Surroundings";
import type { Trial } from "./trial";

const UP = new Vector3(0, 0, 1);
const seen = new WeakMap<Trial, Trial>();

function from(values: Float32Array, at: number): Vector3 {
  return new Vector3(values[at], values[at + 1], values[at + 2]);
}

/**
 * A trial as somebody sees it who flies along: the ground of a planet is unrolled below the first block, so that it
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

/** Places seen from a planet's centre, from its side: the plane in which they turn most, the first one upwards. */
export function sidePath(arms: readonly Vector3[]): [number, number][] {
  const [first] = arms;
  if (first === undefined) return [];
  const top = first.clone().normalize();
  const axis = new Vector3();
  arms.slice(1).forEach((arm, index) => axis.add(new Vector3().crossVectors(arms[index] ?? arm, arm)));
  axis.addScaledVector(top, -axis.dot(top));
  if (axis.length() < 1e-9) axis.set(0, 1, 0);
  const aside = new Vector3().crossVectors(axis.normalize(), top);
  return arms.map((arm) => [arm.dot(aside), arm.dot(top)]);
}

/** The path of a trial's first block round a planet that is straight below, as it was recorded. */
export function pathOf(trial: Trial, radius: number): [number, number][] {
  const stride = 3 * trial.blockIds.length;
  const center = new Vector3(0, 0, -radius);
  return sidePath(Array.from(trial.times, (_, instant) => from(trial.positions, instant * stride).sub(center)));
}

export interface RecordedFlight {
  times: Float64Array;
  path: [number, number][];
  /** From the planet's centre; heights along z where it is not known. */
  distances: Float64Array;
}

/** A flight that somebody recorded, place by place. */
export function flightOf(
  times: readonly number[],
  places: readonly (readonly number[])[],
  center: readonly number[] | null,
): RecordedFlight {
  const vectors = places.map(([x, y, z]) => new Vector3(x, y, z));
  const [x, y, z] = center ?? [0, 0, 0];
  const arms = vectors.map((place) => place.clone().sub(new Vector3(x, y, z)));
  return {
    times: Float64Array.from(times),
    path: sidePath(arms),
    distances: Float64Array.from(arms, (arm) => (center === null ? arm.z : arm.length())),
  };
}
