import modules from "virtual:modules";

export type Vector = readonly [number, number, number];

export type Solid =
  | { shape: "box"; from: Vector; to: Vector }
  | { shape: "cylinder"; radius: number; from: Vector; to: Vector };

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

const BY_NAME: ReadonlyMap<string, ModuleShape> = new Map(found.map((module) => [module.name, module]));
const UNKNOWN: readonly Solid[] = [{ shape: "box", from: [-0.5, -0.5, 0], to: [0.5, 0.5, 1] }];

/** How a module looks; a module of somebody's own is shown as a small cube. */
export function moduleShape(name: string): ModuleShape {
  return BY_NAME.get(name) ?? { name, kind: "block", center: [0, 0, 0.5], body: UNKNOWN };
}

/** The colours of the service's own pictures, so that page and picture never differ. */
export const KIND_COLOURS: Readonly<Record<string, string>> = {
  start: "#cc5c45",
  block: "#c79e6b",
  wheel: "#545966",
  cannon: "#4d8cba",
  torch: "#e8a338",
  connector: "#736b66",
  cargo: "#859966",
};
