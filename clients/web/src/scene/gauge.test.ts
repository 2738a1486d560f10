import { expect, it } from "vitest";
import { northOnScreen, roundLength } from "./gauge";
import { floorUnder, shade } from "./shadow";

it("measures in lengths that are easy to read", () => {
  expect([0.7, 1, 1.9, 2.4, 7, 99, 260].map(roundLength)).toEqual([0.5, 1, 1, 2, 5, 50, 200]);
});

it("points to the north: up where one looks there, left where one looks east", () => {
  expect(
    [
      [0, 1],
      [1, 0],
      [0, -1],
    ].map(([x = 0, y = 0]) => northOnScreen({ x, y })),
  ).toEqual([-0, -90, -180]);
});

it("lets shadows fall on the highest level thing below, fainter from above", () => {
  const box = { center: [0, 10, 1], size: [4, 4, 2] } as const;
  const sloping = { ...box, slope_deg: 10 };
  expect(floorUnder(0, 10, 3, [box], 0)).toBe(2);
  expect(floorUnder(0, 10, 1, [box], 0)).toBe(0);
  expect(floorUnder(0, 13, 3, [box, sloping], 0)).toBe(0);
  expect([shade(0), shade(3), shade(60)]).toEqual([1, 0.25, 0]);
});
