import { expect, it } from "vitest";
import { worldLine } from "./worlds";

it("a world is a line: what it came to, or why it failed", () => {
  const world = { rollout: 0, exact: true, success: true, indicator: 36, flags: [], explanation: "It held." };
  const broken = { ...world, rollout: 2, exact: false, success: false, explanation: "The bridge broke." };
  const worlds = [world, { ...world, rollout: 1, exact: false }, broken, { ...broken, explanation: "It held." }];
  expect(worlds.map((one) => worldLine(one, worlds))).toEqual([
    "✓ Exact world 36.0",
    "✓ World 1 36.0",
    "✗ World 2: The bridge broke.",
    "✗ World 3: the same",
  ]);
});
