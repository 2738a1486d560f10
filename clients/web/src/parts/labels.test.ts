import { expect, it } from "vitest";
import { apart } from "./labels";

const SIZE = { width: 300, height: 200 };
const box = (x: number, y: number, width = 80) => ({ x, y, width, height: 14 });

it("labels that cover each other move up and down by lines, the first stays", () => {
  expect(apart([box(10, 100), box(40, 100), box(50, 104)], [], SIZE, 10)).toEqual([
    { dx: 0, dy: 0 },
    { dx: 0, dy: -14 },
    { dx: 0, dy: 14 },
  ]);
});

it("a label without room on the right stands on the left of its point, within the drawing", () => {
  expect(apart([box(250, 50)], [], SIZE, 10)).toEqual([{ dx: -100, dy: 0 }]);
  expect(apart([box(150, 50, 200)], [], SIZE, 10)).toEqual([{ dx: -150, dy: 0 }]);
});

it("no label leaves the drawing above or below", () => {
  const shifts = apart([box(10, 2), box(10, 2), box(10, 2)], [], SIZE, 10);
  expect(shifts.map((shift) => shift?.dy)).toEqual([0, 14, 28]);
});

it("a label covers no point", () => {
  expect(apart([box(10, 50)], [box(60, 52, 10)], SIZE, 10)).toEqual([{ dx: 0, dy: -14 }]);
});

it("of labels that crowd around one point some are left out", () => {
  const shifts = apart(
    Array.from({ length: 7 }, () => box(10, 100)),
    [],
    SIZE,
    10,
  );
  expect(shifts.filter((shift) => shift === null)).toHaveLength(2);
});
