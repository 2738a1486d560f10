import modules from "virtual:modules";

export type Vector = readonly [number, number, number];

export type Solid =
  | { shape: "box"; from: Vector; to: Vector }
  | { shape: "cylinder"; radius: number; from: Vector; to: Vector }
  | { shape: "sphere"; radius: number; center: Vector };

export interface ModuleShape {
  name: string;
  kind: string;
  center: Vector;
  body: readonly Solid[];
}

const ORIGIN: Vector = [0, 0, 0];

const found = modules.map((module) => ({
  name: module.name,
  kind: module.kind,
  center: module.center ?? ORIGIN,
  body: module.body ?? [],
}));

const BY_NAME = new Map(found.map((module) => [module.name, module]));
const UNKNOWN: readonly Solid[] = [{ shape: "box", from: [-0.5, -0.5, 0], to: [0.5, 0.5, 1] }];

interface BodyView {
  shape: "box" | "cylinder" | "sphere";
  center: readonly number[];
  quaternion: readonly number[];
  size: readonly number[];
}

/** Learns what users' own modules look like, from a scene that has blocks of them. */
export function learnShapes(
  modules: Readonly<Record<string, { kind: string; center: readonly number[]; bodies: readonly BodyView[] }>>,
): void {
  for (const [name, { kind, center, bodies }] of Object.entries(modules)) {
    if (!BY_NAME.has(name))
      BY_NAME.set(name, {
        name,
        kind,
        center: [center[0] ?? 0, center[1] ?? 0, center[2] ?? 0],
        body: bodies.map(solidOf),
      });
  }
}

function solidOf({ shape, center, quaternion, size }: BodyView): Solid {
  if (shape === "sphere")
    return { shape, radius: (size[0] ?? 0) / 2, center: [center[0] ?? 0, center[1] ?? 0, center[2] ?? 0] };
  const [w, x, y, z] = [quaternion[0] ?? 1, quaternion[1] ?? 0, quaternion[2] ?? 0, quaternion[3] ?? 0];
  const half = (size[2] ?? 0) / 2;
  // A cylinder's axis is its own z, turned.
  const axis = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)].map((value) => value * half);
  const reach = shape === "cylinder" ? axis : size.map((value) => value / 2);
  const corner = (sign: number): Vector =>
    [0, 1, 2].map((k) => (center[k] ?? 0) + sign * (reach[k] ?? 0)) as unknown as Vector;
  return shape === "box"
    ? { shape, from: corner(-1), to: corner(1) }
    : { shape, radius: (size[0] ?? 0) / 2, from: corner(-1), to: corner(1) };
}

/** How a module looks; a user's own module is shown as a small cube. */
export function moduleShape(name: string): ModuleShape {
  return BY_NAME.get(name) ?? { name, kind: "block", center: [0, 0, 0.5], body: UNKNOWN };
}

/** The colours of the service's own pictures, so that page and picture never differ. */
export const KIND_COLOURS: Readonly<Record<string, string>> = {
  start: "#cc5c45",
  block: "#c79e6b",
  joint: "#99739e",
  wheel: "#545966",
  flight: "#dbcca8",
  cannon: "#4d8cba",
  torch: "#e8a338",
  device: "#8c99a3",
  connector: "#736b66",
  cargo: "#859966",
};
