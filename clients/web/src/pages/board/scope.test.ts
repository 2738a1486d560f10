import { expect, it } from "vitest";
import { rankedOver, scopeOf, scopesOf } from "./scope";

const TASKS = ["transport", "support", "lift", "mechanisms", "flight", "control"].map((category) => ({ category }));

it("every category is a scope, and the paper’s nine are one", () => {
  expect(scopesOf(TASKS).map((scope) => scope.label)).toEqual([
    "All tasks",
    "The paper’s nine",
    "Vehicles",
    "Bridges",
    "Rockets",
    "Mechanisms",
    "Flight",
    "Control",
  ]);
  expect(scopesOf([{ category: "flight" }]).map((scope) => scope.key)).toEqual(["", "flight"]);
});

it("an address names its scope, whatever it asks for", () => {
  expect(scopeOf({}).key).toBe("");
  expect(scopeOf({ category: ["lift"] }).label).toBe("Rockets");
  expect(scopeOf({ category: ["lift", "transport", "support"] }).key).toBe("paper");
  expect(scopeOf({ category: ["flight", "my_own"] }).label).toBe("Flight, My own");
});

it("says what the ranking is over", () => {
  expect(rankedOver([], 4)).toBe("");
  expect(rankedOver(["flight-2", "flight-3"], 2)).toBe("Ranked over flight-2, flight-3.");
  expect(rankedOver(["flight-2"], 2)).toBe("Ranked over flight-2; 1 other task below is not in it.");
  expect(rankedOver(Array<string>(12).fill("t"), 14)).toBe("Ranked over 12 tasks; 2 other tasks below are not in it.");
});
