import { Box3, Vector3 } from "three";
import { describe, expect, it } from "vitest";
import type { Scenario } from "./Surroundings";
import type { Trial } from "./trial";
import { breakCaption, framed, viewOf } from "./views";

const FLAT: Scenario = { duration_s: 5, terrain: [], cargo: null, placement: { kind: "drop" } };
const GAP: Scenario = { ...FLAT, placement: { kind: "span", gap: 20 } };

describe("the first look", () => {
  const block = new Box3(new Vector3(-0.5, -0.5, 5), new Vector3(0.5, 0.5, 6));

  it("is low along a gap, with both banks in the picture", () => {
    expect(viewOf(GAP).z).toBeLessThan(viewOf(FLAT).z / 1.5);
    const { min, max } = framed(block, GAP);
    expect([min.y, max.y]).toEqual([-12, 12]);
    expect(framed(block, FLAT)).toEqual(block);
  });
});

describe("a picture's caption", () => {
  const cargo = { mass: Float64Array.of(5, 601.4, 900) };
  const trial = { times: Float64Array.of(0, 5, 10), breaks: [{ time_s: 5.6 }], cargo } as unknown as Trial;

  it("says what was held and when it broke, once it has", () => {
    expect(breakCaption(trial, 5)).toBeNull();
    expect(breakCaption(trial, 5.6)).toBe("601 held, broke at 5.6 s");
    expect(breakCaption({ ...trial, cargo: null }, 9)).toBe("Broke at 5.6 s");
    expect(breakCaption({ ...trial, breaks: [] }, 9)).toBeNull();
  });
});
