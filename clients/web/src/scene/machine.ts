import { Box3, Matrix4, Quaternion, Vector3 } from "three";
import type { Schema } from "../api/client";
import { learnShapes, moduleShape, type Solid, type Vector } from "./modules";

export type MachineScene = Schema<"MachineScene">;
export type PlacedView = Schema<"PlacedPart">;
export type PartView = Schema<"Part">;

export interface Part {
  id: string;
  module: string;
  kind: string;
  /** world_from_block at the origin of the block's frame. */
  pose: Matrix4;
}

export interface Rod {
  id: string;
  module: string;
  /** What trajectories call it. */
  joint: string;
  /** The blocks that it sits on; null for an end that is given in the world's frame. */
  startBlock: string | null;
  endBlock: string | null;
  /** Ends in the frames of the blocks they sit on. */
  startLocal: Vector3;
  endLocal: Vector3;
}

export interface Machine {
  parts: readonly Part[];
  rods: readonly Rod[];
}

const ONE = new Vector3(1, 1, 1);

function vector(values: Vector): Vector3 {
  return new Vector3(values[0], values[1], values[2]);
}

/** A pose as a matrix; the service has quaternions as (w, x, y, z). */
export function poseOf(position: Vector, wxyz: readonly [number, number, number, number]): Matrix4 {
  const [w, x, y, z] = wxyz;
  return new Matrix4().compose(vector(position), new Quaternion(x, y, z, w), ONE);
}

export function partOf({ id, module, position, quaternion }: Omit<PlacedView, "start">): Part {
  return { id, module, kind: moduleShape(module).kind, pose: poseOf(position, quaternion) };
}

/** The parts of a trial's machine, ready to be drawn. */
export function readScene(scene: MachineScene): Machine {
  learnShapes(scene.modules);
  return {
    parts: scene.blocks.map(partOf),
    rods: scene.connectors.map(({ id, module, joint, start, end }) => ({
      id,
      module,
      joint,
      startBlock: start.block,
      endBlock: end.block,
      startLocal: vector(start.point),
      endLocal: vector(end.point),
    })),
  };
}

/** The machine of a step of a replay. */
export function machineOf(parts: Iterable<PartView>): Machine {
  const machine: { parts: Part[]; rods: Rod[] } = { parts: [], rods: [] };
  for (const part of parts) {
    if (part.start === null || part.end === null) machine.parts.push(partOf(part));
    else {
      const { id, module, start, end } = part;
      machine.rods.push({
        id,
        module,
        joint: `${module} ${id}`,
        startBlock: null,
        endBlock: null,
        startLocal: vector(start),
        endLocal: vector(end),
      });
    }
  }
  return machine;
}

function solidBox(solid: Solid): Box3 {
  if (solid.shape === "sphere")
    return new Box3(vector(solid.center), vector(solid.center)).expandByScalar(solid.radius);
  const box = new Box3().setFromPoints([vector(solid.from), vector(solid.to)]);
  // A cylinder's corners lie within its radius around its axis, whichever way that points.
  return solid.shape === "box" ? box : box.expandByScalar(solid.radius);
}

/** The box around all parts, world frame. */
export function boundsOf(machine: Machine): Box3 {
  const whole = new Box3();
  for (const part of machine.parts) {
    for (const solid of moduleShape(part.module).body) whole.union(solidBox(solid).applyMatrix4(part.pose));
  }
  return whole;
}
