import { Matrix4, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import { boundsOf, readMachine, type MachineDocument } from "./machine";
import { poseAt } from "./playing";
import { instantAt, type Trial } from "./trial";

const block = (id: string, module: string, position: [number, number, number], quaternion: [number, number, number, number]) => ({
  id,
  module,
  position,
  quaternion,
  mount: null,
  bindings: {},
  flipped: false,
  note: "",
  structure: "",
});
const CYCLE: [number, number, number, number] = [0.5, 0.5, 0.5, 0.5];
const DOCUMENT: MachineDocument = {
  blocks: [block("1", "Starting Block", [0, 0, 2], [1, 0, 0, 0]), block("2", "Small Wooden Block", [0.5, 0, 2], CYCLE)],
  connectors: [
    { id: "7", module: "Brace", start: ["1", "A"], end: ["2", "E"], position: [0.5, 0, 2], quaternion: CYCLE, span: [0, -1.5, -0.5] },
  ],
  control_sequence: [],
};

const at = (matrix: Matrix4): number[] => new Vector3().setFromMatrixPosition(matrix).toArray();

describe("readMachine", () => {
  it("turns blocks the way documents mean: z of the block becomes x of the world", () => {
    const part = readMachine(DOCUMENT).parts[1];
    const top = new Vector3(0, 0, 1).applyMatrix4(part?.pose ?? new Matrix4());
    expect(top.toArray().map((value) => Math.round(value * 1e6) / 1e6)).toEqual([1.5, 0, 2]);
  });

  it("puts a connector's end where its span says", () => {
    const { parts, rods } = readMachine(DOCUMENT);
    const end = rods[0]?.endLocal.clone().applyMatrix4(parts[1]?.pose ?? new Matrix4()).toArray() ?? [];
    [0, 0, 0.5].forEach((value, axis) => {
      expect(end[axis]).toBeCloseTo(value);
    });
  });

  it("finds the box around it", () => {
    const box = boundsOf(readMachine(DOCUMENT));
    expect(box.min.x).toBeCloseTo(-0.5);
    expect(box.max.x).toBeCloseTo(1.5);
  });
});

const TRIAL: Trial = {
  times: Float64Array.of(0, 1, 2),
  blockIds: ["1", "2"],
  positions: Float32Array.of(0, 0, 2, 1, 0, 2, 0, 0, 3, 1, 0, 3, 0, 0, 5, 1, 0, 5),
  quaternions: Float32Array.of(...[0, 1, 2].flatMap(() => [1, 0, 0, 0, ...CYCLE])),
  cargo: null,
  peaks: [],
  breaks: [],
  engine: "e",
  engineVersion: "1",
};

describe("a trial", () => {
  it.each([
    [-1, 0, 0],
    [0.25, 0, 0.25],
    [1, 1, 0],
    [9, 2, 0],
    [NaN, 0, 0],
  ])("at %d s is between instants", (time, index, share) => {
    if (Number.isNaN(time)) expect(instantAt(Float64Array.of(0), time)).toEqual({ index: 0, share: 0 });
    else expect(instantAt(TRIAL.times, time)).toEqual({ index, share });
  });

  it("gives a block's root from its shown point, between instants too", () => {
    const part = readMachine(DOCUMENT).parts[1];
    if (part === undefined) throw new Error("no part");
    // The wooden block is shown at its middle, half a unit along its own z, which is the world's x.
    const [x, y, z] = at(poseAt(TRIAL, 1.5)(part, new Matrix4()));
    expect([x, y, z].map((value) => Math.round((value ?? 0) * 1e5) / 1e5)).toEqual([0.5, 0, 4]);
    expect(at(poseAt(TRIAL, 99)(part, new Matrix4()))[2]).toBeCloseTo(5);
  });
});
