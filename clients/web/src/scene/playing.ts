import { Box3, Matrix4, Quaternion, Vector3 } from "three";
import { boundsOf, type Machine } from "./machine";
import type { PoseNow } from "./Parts";
import { moduleShape } from "./modules";
import { instantAt, type Trial } from "./trial";

const ONE = new Vector3(1, 1, 1);

function point(values: Float32Array, at: number): Vector3 {
  return new Vector3(values[at], values[at + 1], values[at + 2]);
}

function turn(values: Float32Array, at: number): Quaternion {
  return new Quaternion(values[at + 1], values[at + 2], values[at + 3], values[at]);
}

function blended(
  positions: Float32Array,
  quaternions: Float32Array,
  item: number,
  count: number,
  index: number,
  share: number,
): [Vector3, Quaternion] {
  const [from, to] = [index * count + item, Math.min(index + 1, positions.length / 3 / count - 1) * count + item];
  const place = point(positions, 3 * from);
  const facing = turn(quaternions, 4 * from);
  if (share > 0) {
    place.lerp(point(positions, 3 * to), share);
    facing.slerp(turn(quaternions, 4 * to), share);
  }
  return [place, facing];
}

const known = new WeakMap<Trial, Map<string, number>>();

/** The place of each block in the trial's arrays. */
function placesIn(trial: Trial): Map<string, number> {
  const places = known.get(trial) ?? new Map(trial.blockIds.map((id, item) => [id, item]));
  known.set(trial, places);
  return places;
}

/** Where parts are at a time. The trajectory has the shown points; a pose has the block's root. */
export function poseAt(trial: Trial, time: number): PoseNow {
  const { index, share } = instantAt(trial.times, time);
  const places = placesIn(trial);
  return (part, into) => {
    const item = places.get(part.id);
    if (item === undefined) return into.copy(part.pose);
    const [place, facing] = blended(trial.positions, trial.quaternions, item, trial.blockIds.length, index, share);
    const [x, y, z] = moduleShape(part.module).center;
    place.sub(new Vector3(x, y, z).applyQuaternion(facing));
    return into.compose(place, facing, ONE);
  };
}

/** Where the cargo is at a time, as the pose of its centre. */
export function cargoAt(trial: Trial, time: number, into: Matrix4): Matrix4 {
  if (trial.cargo === null) return into.identity();
  const { index, share } = instantAt(trial.times, time);
  const [place, facing] = blended(trial.cargo.positions, trial.cargo.quaternions, 0, 1, index, share);
  return into.compose(place, facing, ONE);
}

/** The box around everything that moves, as the trial begins. */
export function startBounds(machine: Machine, trial: Trial): Box3 {
  const start = poseAt(trial, 0);
  const whole = boundsOf({
    ...machine,
    parts: machine.parts.map((part) => ({ ...part, pose: start(part, part.pose.clone()) })),
  });
  if (trial.cargo !== null) {
    const size = new Vector3(...trial.cargo.size);
    whole.union(
      new Box3().setFromCenterAndSize(new Vector3().setFromMatrixPosition(cargoAt(trial, 0, new Matrix4())), size),
    );
  }
  return whole;
}
