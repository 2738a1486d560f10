import { expect, it } from "vitest";
import { seenAlong } from "./flight";
import type { Scenario } from "./Surroundings";
import type { Trial } from "./trial";

const RADIUS = 600;
const HEIGHT = 40;
const COUNT = 101;
const SCENARIO: Scenario = {
  duration_s: 4,
  terrain: [],
  cargo: null,
  placement: { kind: "ground" },
  planet: { radius: RADIUS },
};

/** A block that is carried once round towards the north, its own top upwards. */
function around(): Trial {
  const angles = Array.from({ length: COUNT }, (_, k) => (2 * Math.PI * k) / (COUNT - 1));
  const away = RADIUS + HEIGHT;
  return {
    times: Float64Array.from(angles, (_, k) => 0.04 * k),
    blockIds: ["1"],
    positions: Float32Array.from(angles.flatMap((a) => [0, away * Math.sin(a), away * Math.cos(a) - RADIUS])),
    quaternions: Float32Array.from(angles.flatMap((a) => [Math.cos(a / 2), -Math.sin(a / 2), 0, 0])),
    cargo: null,
    peaks: [],
    loads: null,
    breaks: [],
    engine: "mujoco",
    engineVersion: "3",
  };
}

it("rolls the ground by as far as the planet is round, and keeps what is upright upright", () => {
  const trial = around();
  const shown = seenAlong(trial, SCENARIO);
  for (let k = 0; k < COUNT; k += 10) {
    expect(shown.positions[3 * k + 2]).toBeCloseTo(HEIGHT, 2);
    expect(Math.abs(shown.quaternions[4 * k] ?? 0)).toBeCloseTo(1, 4);
  }
  expect((shown.positions[3 * COUNT - 2] ?? 0) / (2 * Math.PI * RADIUS)).toBeCloseTo(1, 2);
  expect(seenAlong(trial, SCENARIO)).toBe(shown);
});

it("leaves a trial on flat ground as it is", () => {
  const trial = around();
  expect(seenAlong(trial, { ...SCENARIO, planet: null })).toBe(trial);
});
