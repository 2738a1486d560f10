import { Euler, Matrix4, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import { boundsOf, machineOf, readScene, type MachineScene } from "./machine";
import { jointsOf, loadsAt, mostLoaded, shownSize } from "./loads";
import { moduleShape } from "./modules";
import { poseAt } from "./playing";
import { linePoints, lineStrip, markAt, posts, turnOf } from "./signs";
import { instantAt, type Trial } from "./trial";

const CYCLE: [number, number, number, number] = [0.5, 0.5, 0.5, 0.5];
const SCENE: MachineScene = {
  modules: {
    "Own Wheel": {
      kind: "wheel",
      center: [0, 0, 1],
      pointing: null,
      bodies: [{ shape: "cylinder", center: [0, 0, 1], quaternion: [0.5 ** 0.5, 0, 0.5 ** 0.5, 0], size: [3, 3, 2] }],
      flames: [],
    },
  },
  blocks: [
    { id: "1", module: "Starting Block", position: [0, 0, 2], quaternion: [1, 0, 0, 0] },
    { id: "2", module: "Small Wooden Block", position: [0.5, 0, 2], quaternion: CYCLE },
  ],
  connectors: [
    {
      id: "7",
      module: "Brace",
      joint: "Brace 7",
      rope: false,
      start: { block: "1", point: [0, 0, 0.5] },
      end: { block: "2", point: [0, 0, 0.5] },
    },
  ],
  controller: "",
};

const at = (matrix: Matrix4): number[] => new Vector3().setFromMatrixPosition(matrix).toArray();

describe("readScene", () => {
  it("turns blocks the way the service means: z of the block becomes x of the world", () => {
    const part = readScene(SCENE).parts[1];
    const top = new Vector3(0, 0, 1).applyMatrix4(part?.pose ?? new Matrix4());
    expect(top.toArray().map((value) => Math.round(value * 1e6) / 1e6)).toEqual([1.5, 0, 2]);
  });

  it("learns what users' own modules look like", () => {
    readScene(SCENE);
    const solid = moduleShape("Own Wheel").body[0];
    // Its axis, its own frame's z, is turned a quarter about y and lies along x.
    expect(solid).toMatchObject({ shape: "cylinder", radius: 1.5 });
    const from = solid !== undefined && "from" in solid ? solid.from : [];
    [-1, 0, 1].forEach((value, axis) => {
      expect(from[axis]).toBeCloseTo(value);
    });
  });

  it("puts a connector of a replay where it says, in the world", () => {
    const { parts, rods } = machineOf([
      {
        id: "1",
        module: "Starting Block",
        position: [0, 0, 2],
        quaternion: [1, 0, 0, 0],
        start: null,
        end: null,
        flipped: false,
        bindings: {},
      },
      {
        id: "7",
        module: "Brace",
        position: [0, 0, 2],
        quaternion: CYCLE,
        start: [0, 0, 2],
        end: [1, 0, 3],
        flipped: false,
        bindings: {},
      },
    ]);
    expect([parts.length, rods[0]?.startBlock, rods[0]?.joint, rods[0]?.endLocal.toArray()]).toEqual([
      1,
      null,
      "Brace 7",
      [1, 0, 3],
    ]);
  });

  it("finds the box around it", () => {
    const box = boundsOf(readScene(SCENE));
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
  peaks: [
    { joint: "1-2", kind: "attachment", force: 1, moment: 1, ratio: 1.25 },
    { joint: "Brace 7", kind: "brace", force: 1, moment: 1, ratio: 0.5 },
  ],
  loads: Float32Array.of(0, 0, 1.25, 0.25, 0, 0.5),
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
    const part = readScene(SCENE).parts[1];
    if (part === undefined) throw new Error("no part");
    // The wooden block is shown at its middle, half a unit along its own z, which is the world's x.
    const [x, y, z] = at(poseAt(TRIAL, 1.5)(part, new Matrix4()));
    expect([x, y, z].map((value) => Math.round((value ?? 0) * 1e5) / 1e5)).toEqual([0.5, 0, 4]);
    expect(at(poseAt(TRIAL, 99)(part, new Matrix4()))[2]).toBeCloseTo(5);
  });
});

describe("loads", () => {
  it("are given with the instant up to which they acted", () => {
    expect([...loadsAt(TRIAL, 0)]).toEqual([0, 0]);
    expect([...loadsAt(TRIAL, 0.3)]).toEqual([1.25, 0.25]);
    expect([...loadsAt(TRIAL, 1)]).toEqual([1.25, 0.25]);
    expect([...loadsAt(TRIAL, 1.1)]).toEqual([0, 0.5]);
    expect([...loadsAt(TRIAL, 99)]).toEqual([0, 0.5]);
    expect([...loadsAt({ ...TRIAL, loads: null }, 1)]).toEqual([1.25, 0.5]);
  });

  it("belong to joints at blocks, and to connectors", () => {
    expect(jointsOf(TRIAL).map((joint) => joint.block)).toEqual(["2", null]);
    expect(mostLoaded(TRIAL, loadsAt(TRIAL, 2))).toMatchObject({ joint: "Brace 7", ratio: 0.5 });
    expect(mostLoaded(TRIAL, loadsAt(TRIAL, 0))).toBeNull();
  });

  it("show only where more than half of a joint's strength is used", () => {
    expect([0, 0.5].map(shownSize)).toEqual([0, 0]);
    expect(shownSize(0.51)).toBeGreaterThan(0.1);
    expect(shownSize(7)).toBe(shownSize(1));
  });
});

describe("posts", () => {
  it("are across the way a gate is crossed, from north towards east", () => {
    const rounded = (heading_deg: number) =>
      posts({ name: "g", center: [4, 10], half_width: 1.5, heading_deg }).map((post) =>
        post.map((value) => Math.round(value * 1e6) / 1e6),
      );
    expect(rounded(0)).toEqual([
      [2.5, 10, 0],
      [5.5, 10, 0],
    ]);
    expect(rounded(90)).toEqual([
      [4, 11.5, 0],
      [4, 8.5, 0],
    ]);
  });
});

describe("marks", () => {
  it("stay, or swing about their centres", () => {
    const mark = { name: "goal", center: [1, 2, 3] as const, radius: 1 };
    expect(markAt(mark, 7)).toEqual([1, 2, 3]);
    const drift = { swing: [4, -2, 1] as const, period_s: [16, 8, 4] as const };
    expect(markAt({ ...mark, drift }, 0)).toEqual([1, 2, 3]);
    markAt({ ...mark, drift }, 2).forEach((value, axis) => {
      expect(value).toBeCloseTo([1 + 4 * Math.sin(Math.PI / 4), 0, 3][axis] ?? 0, 12);
    });
  });
});

describe("a line on the ground", () => {
  const line = { radius: 10, bends: [[0.1, -0.12] as const, [0.04, 0.03] as const], half_width: 0.5 };

  it("begins at the origin towards the north, and bends to the left or, mirrored, to the right", () => {
    const [first, second] = linePoints(line, 2000);
    expect(first).toEqual([0, 0]);
    expect(second?.[1]).toBeGreaterThan(0);
    expect(Math.abs((second?.[0] ?? 1) / (second?.[1] ?? 1))).toBeLessThan(0.01);
    const half = linePoints(line, 2)[1];
    expect(half?.[0]).toBeLessThan(-15);
    expect(linePoints({ ...line, side: -1 }, 2)[1]?.[0]).toBeCloseTo(-(half?.[0] ?? 0));
  });

  it("is a strip of its width", () => {
    const strip = lineStrip(line);
    for (let k = 0; k < strip.length; k += 2) {
      const [right, left] = [strip[k] ?? [0, 0, 0], strip[k + 1] ?? [0, 0, 0]];
      expect(Math.hypot(right[0] - left[0], right[1] - left[1])).toBeCloseTo(1);
    }
  });
});

describe("a box of the terrain", () => {
  it("rises to where it is turned", () => {
    const up = (box: { slope_deg?: number; heading_deg?: number }) =>
      new Vector3(0, 0, 1).applyEuler(new Euler(...turnOf(box))).toArray();
    const [sine, cosine] = [0.5, Math.sqrt(0.75)];
    for (const [box, expected] of [
      [{}, [0, 0, 1]],
      [{ slope_deg: 30 }, [0, -sine, cosine]],
      [{ slope_deg: 30, heading_deg: 90 }, [-sine, 0, cosine]],
    ] as const)
      up(box).forEach((value, axis) => {
        expect(value).toBeCloseTo(expected[axis] ?? 0, 12);
      });
  });
});
