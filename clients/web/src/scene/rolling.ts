import { moduleShape } from "./modules";
import type { Trial } from "./trial";

type Axes = [number, number, number];
/** Radians that a wheel rolls at least, and its share of what the fastest rolled: less is no rolling. */
const LEAST = 2;
const LEAST_SHARE = 0.25;
/** Of all rolling together, what is left over at least where most wheels agree. */
const AGREED = 0.1;
/** The least cosine between two wheels that roll along one line. */
const ALONG = 0.7;

/** Wheels that worked against each other. */
export interface Opposed {
  against: string[];
  /** Those that they rolled against; it is told by name where these are no more than they. */
  others: string[];
  balanced: boolean;
}

/**
 * The wheels of a trial that rolled against the others, seen from the starting block; null where none did.
 *
 * A wheel on the ground that turns by w carries its axle towards w x up.
 */
export function opposedWheels(
  trial: Pick<Trial, "times" | "blockIds" | "quaternions">,
  blocks: readonly { id: string; module: string }[],
): Opposed | null {
  const wheels = blocks
    .filter(({ id, module }) => moduleShape(module).kind === "wheel" && trial.blockIds.includes(id))
    .map(({ id }) => ({ id, rolled: rolledBy(trial, trial.blockIds.indexOf(id)) }));
  const fastest = Math.max(0, ...wheels.map(({ rolled }) => size(rolled)));
  const rolling = wheels.filter(({ rolled }) => size(rolled) > Math.max(LEAST, LEAST_SHARE * fastest));
  const sum = rolling.reduce<Axes>((whole, { rolled }) => plus(whole, rolled), [0, 0, 0]);
  const all = rolling.reduce((whole, { rolled }) => whole + size(rolled), 0);
  const balanced = size(sum) < AGREED * all;
  const way = balanced ? (rolling[0]?.rolled ?? sum) : sum;
  const along = (rolled: Axes): number => dot(rolled, way) / (size(rolled) * size(way));
  const against = rolling.filter(({ rolled }) => along(rolled) < -ALONG).map(({ id }) => id);
  const others = rolling.filter(({ rolled }) => along(rolled) > ALONG).map(({ id }) => id);
  return against.length === 0 || others.length === 0 ? null : { against, others, balanced };
}

/** What is to be said of them. */
export function opposedWords({ against, others, balanced }: Opposed): string {
  const named = `${against.length === 1 ? "Wheel" : "Wheels"} ${listed(against)} rolled against `;
  if (balanced) return `${named}${others.length === 1 ? "wheel" : "wheels"} ${listed(others)}.`;
  return `${named}the others: turned backwards.`;
}

function listed(ids: readonly string[]): string {
  return ids.length < 2 ? ids.join("") : `${ids.slice(0, -1).join(", ")} and ${ids.at(-1) ?? ""}`;
}

/** How far a wheel rolled which way, radians, in the frame of the starting block. */
function rolledBy({ times, blockIds, quaternions }: Pick<Trial, "times" | "blockIds" | "quaternions">, wheel: number) {
  let whole: Axes = [0, 0, 0];
  const at = (instant: number, block: number): number => 4 * (instant * blockIds.length + block);
  for (let instant = 1; instant < times.length; instant += 1) {
    const [x, y] = turnBetween(quaternions, at(instant - 1, wheel), at(instant, wheel));
    whole = plus(whole, intoFrame(quaternions, at(instant, 0), [y, -x, 0]));
  }
  return whole;
}

/** The turn from one orientation to another as axis times angle, world frame. */
function turnBetween(q: Float32Array, from: number, to: number): Axes {
  const [a, b, c, d] = [q[from] ?? 1, -(q[from + 1] ?? 0), -(q[from + 2] ?? 0), -(q[from + 3] ?? 0)];
  const [w, x, y, z] = [q[to] ?? 1, q[to + 1] ?? 0, q[to + 2] ?? 0, q[to + 3] ?? 0];
  const real = w * a - x * b - y * c - z * d;
  const sign = real < 0 ? -1 : 1;
  const axis: Axes = [
    sign * (w * b + x * a + y * d - z * c),
    sign * (w * c - x * d + y * a + z * b),
    sign * (w * d + x * c - y * b + z * a),
  ];
  const length = size(axis);
  const scale = length < 1e-9 ? 0 : (2 * Math.atan2(length, Math.abs(real))) / length;
  return [axis[0] * scale, axis[1] * scale, axis[2] * scale];
}

/** A direction of the world's frame in that of a block. */
function intoFrame(q: Float32Array, at: number, v: Axes): Axes {
  const w = q[at] ?? 1;
  const u: Axes = [-(q[at + 1] ?? 0), -(q[at + 2] ?? 0), -(q[at + 3] ?? 0)];
  const t = cross(u, v);
  const s = cross(u, t);
  return [v[0] + 2 * (w * t[0] + s[0]), v[1] + 2 * (w * t[1] + s[1]), v[2] + 2 * (w * t[2] + s[2])];
}

const size = (v: Axes): number => Math.hypot(...v);
const dot = (a: Axes, b: Axes): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const plus = (a: Axes, b: Axes): Axes => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const cross = (a: Axes, b: Axes): Axes => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
