import { expect, it } from "vitest";
import { firstNames, pilotingCurves } from "./curves";
import type { Piloting } from "./trial";

const PILOTING: Piloting = {
  senseNames: ["position.x", "up.z"],
  senses: Float32Array.of(1, 0.5, 2, 0.25, NaN, NaN),
  actionNames: ["3.fly", "4.fly"],
  answers: Float32Array.of(0, 1, 0.5, 0.75, 0, 0),
};

it("has a curve for each name that was sensed or asked for, in the order of the names", () => {
  const curves = pilotingCurves(PILOTING, ["up.z", "4.fly", "none.x", "3.fly"]);
  expect(curves.map(({ name, unit }) => [name, unit])).toEqual([
    ["up.z", "sensed"],
    ["4.fly", "asked for"],
    ["3.fly", "asked for"],
  ]);
  expect(curves.map(({ values }) => [...values])).toEqual([
    [0.5, 0.25, 0.25],
    [1, 0.75, 0],
    [0, 0.5, 0],
  ]);
});

it("draws actions before anything is chosen", () => {
  expect(firstNames(PILOTING)).toEqual(["3.fly", "4.fly"]);
  expect(firstNames({ ...PILOTING, actionNames: [] })).toEqual([]);
});
