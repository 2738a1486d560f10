import { expect, it } from "vitest";
import { opposedWheels, opposedWords } from "./rolling";

const STEPS = 40;
const blocks = (wheels: number) => [
  { id: "1", module: "Starting Block" },
  ...Array.from({ length: wheels }, (_, index) => ({ id: String(index + 2), module: "Powered Wheel" })),
];

/** A trial of a machine that turns about the vertical, whose wheels turn about its own y axis at some speeds. */
function trialOf(speeds: readonly number[], yaw = 0) {
  const quaternions: number[] = [];
  for (let step = 0; step < STEPS; step += 1) {
    const heading = (yaw * step) / STEPS / 2;
    const [c, s] = [Math.cos(heading), Math.sin(heading)];
    quaternions.push(c, 0, 0, s);
    for (const speed of speeds) {
      const [d, y] = [Math.cos((speed * step) / 2), Math.sin((speed * step) / 2)];
      quaternions.push(c * d, -s * y, c * y, s * d);
    }
  }
  const blockIds = blocks(speeds.length).map(({ id }) => id);
  return { times: Float64Array.from({ length: STEPS }), blockIds, quaternions: Float32Array.from(quaternions) };
}

const said = (speeds: readonly number[], yaw?: number): string | null => {
  const found = opposedWheels(trialOf(speeds, yaw), blocks(speeds.length));
  return found === null ? null : opposedWords(found);
};

it("wheels that roll against the others are told, also where the machine turns", () => {
  expect(said([0.4, 0.4, 0.4, 0.3])).toBeNull();
  expect(said([0.4, -0.4, 0.4, 0.4, 0.4])).toBe("Wheel 3 rolled against the others: turned backwards.");
  expect(said([-0.4, -0.4, 0.4, 0.4, 0.4], 6)).toBe("Wheels 2 and 3 rolled against the others: turned backwards.");
});

it("of as many that roll one way as the other, no side is said to be wrong", () => {
  expect(said([0.4, -0.4, 0.4, -0.4])).toBe("Wheels 3 and 5 rolled against wheels 2 and 4.");
});

it("wheels that hardly turn, and machines without wheels, are not spoken of", () => {
  expect(said([0.4, -0.01, 0.4, 0.4])).toBeNull();
  expect(said([0.001, -0.001])).toBeNull();
  expect(said([])).toBeNull();
});
