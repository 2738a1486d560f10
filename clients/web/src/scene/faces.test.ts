import { Vector3 } from "three";
import { describe, expect, it } from "vitest";
import { faceAt } from "./faces";

const cube = [
  { label: "A", center: [0.5, 0, 0], normal: [1, 0, 0] },
  { label: "B", center: [-0.5, 0, 0], normal: [-1, 0, 0] },
  { label: "C", center: [0, 0, 0.5], normal: [0, 0, 1] },
] as const;
const hit = (point: readonly [number, number, number], normal: readonly [number, number, number]) => ({
  point: new Vector3(...point),
  normal: new Vector3(...normal),
});

describe("the face that was clicked", () => {
  it("looks the way its surface does", () => {
    expect(faceAt(cube, hit([0.5, 0.49, 0.49], [1, 0, 0]))?.label).toBe("A");
    expect(faceAt(cube, hit([0.49, 0, 0.5], [0, 0, 1]))?.label).toBe("C");
  });

  it("is none where no face is", () => {
    expect(faceAt(cube, hit([0, -0.5, 0], [0, -1, 0]))).toBeUndefined();
    expect(faceAt(cube, hit([0, 0, 0], [1, 0, 0]))).toBeUndefined();
    expect(faceAt([], hit([0.5, 0, 0], [1, 0, 0]))).toBeUndefined();
    expect(faceAt(cube, undefined)).toBeUndefined();
  });

  it("is the nearest of several that look the same way", () => {
    const long = [...cube, { label: "D", center: [0.5, 2, 0], normal: [1, 0, 0] }] as const;
    expect(faceAt(long, hit([0.5, 1.7, 0], [1, 0, 0]))?.label).toBe("D");
  });
});
