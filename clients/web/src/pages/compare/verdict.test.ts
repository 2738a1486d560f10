import { expect, it } from "vitest";
import { betterOn, verdictOf, type Comparison } from "./verdict";

function task(name: string, success: [number, number] | null, indicator: [number, number] | null = null): object {
  const test = (of: [number, number] | null): object | null =>
    of === null ? null : { pairs: 9, p_value: of[1], difference: of[0], method: "exact McNemar" };
  return {
    task: name,
    difference: success?.[0] ?? 0,
    success: test(success),
    success_p: success?.[1] ?? null,
    indicator: test(indicator),
    indicator_p: indicator?.[1] ?? null,
  };
}

const found = (...tasks: object[]): Comparison => ({ first: "a", second: "b", tasks }) as unknown as Comparison;

it("names who is better where the tests show it, and nobody elsewhere", () => {
  const [ahead, behind, open] = [task("x", [0.5, 0.01]), task("y", [0, 1], [-3, 0.04]), task("z", [0.4, 0.2])];
  expect(verdictOf(found(ahead, behind, open))).toBe(
    "a is better on x, and b is better on y, beyond chance; on one other the shared seeds show nothing.",
  );
  expect(verdictOf(found(ahead))).toBe("a is better on x, beyond chance.");
  expect(verdictOf(found(open))).toBe("The shared seeds do not show that a or b is better on this task.");
  expect(verdictOf(found(open, task("w", null)))).toContain("on any task");
});

it("claims nothing where success and indicator point in opposite directions", () => {
  const [one] = found(task("x", [0.5, 0.01], [-2, 0.01])).tasks;
  expect(one === undefined ? 1 : betterOn(one)).toBe(0);
});
