import { Box3, Matrix4, Quaternion, Vector3 } from "three";
import { moduleShape, type Solid, type Vector } from "./modules";

/** A machine document, as far as a page draws it. */
export interface MachineDocument {
  blocks: {
    id: string;
    module: string;
    position: Vector;
    quaternion: readonly [number, number, number, number];
    mount: readonly [string, string] | null;
    bindings: Record<string, string[]>;
    flipped: boolean;
    note: string;
    structure: string;
  }[];
  connectors: {
    id: string;
    module: string;
    start: readonly [string, string];
    end: readonly [string, string];
    position: Vector;
    quaternion: readonly [number, number, number, number];
    span: Vector;
  }[];
  control_sequence: { time_s: number; key: string; hold_for_s: number }[];
}

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
  startBlock: string;
  endBlock: string;
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

/** A pose as a matrix; documents have quaternions as (w, x, y, z). */
export function poseOf(position: Vector, wxyz: readonly [number, number, number, number]): Matrix4 {
  const [w, x, y, z] = wxyz;
  return new Matrix4().compose(vector(position), new Quaternion(x, y, z, w), ONE);
}

/** The parts of a machine, ready to be drawn. */
export function readMachine(document: MachineDocument): Machine {
  const parts = document.blocks.map((block) => ({
    id: block.id,
    module: block.module,
    kind: moduleShape(block.module).kind,
    pose: poseOf(block.position, block.quaternion),
  }));
  const poses = new Map(parts.map((part) => [part.id, part.pose]));
  const local = (block: string, point: Vector3): Vector3 =>
    point.clone().applyMatrix4((poses.get(block) ?? new Matrix4()).clone().invert());
  const rods = document.connectors.map((connector) => {
    const start = vector(connector.position);
    const end = vector(connector.span).applyMatrix4(poseOf(connector.position, connector.quaternion));
    return {
      id: connector.id,
      module: connector.module,
      startBlock: connector.start[0],
      endBlock: connector.end[0],
      startLocal: local(connector.start[0], start),
      endLocal: local(connector.end[0], end),
    };
  });
  return { parts, rods };
}

function solidBox(solid: Solid): Box3 {
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
