import { expect, it } from "vitest";
import { liveOf, motionOf, takeFrame } from "../../scene/live";
import { keyOf, signOf } from "./keys";

it("knows which keys of a keyboard are keys of machines", () => {
  expect(["ArrowUp", "Digit7", "Numpad0", "KeyW", "ArrowUpper"].map(keyOf)).toEqual([
    "UpArrow",
    "Alpha7",
    "Keypad0",
    null,
    null,
  ]);
  expect([signOf("LeftArrow"), signOf("Alpha3"), signOf("Keypad3")]).toEqual(["←", "3", "num 3"]);
});

const block = { id: "1", module: "Starting Block", position: [0, 0, 0], quaternion: [1, 0, 0, 0] };

function frame(time: number, ...rows: number[][]): ArrayBuffer {
  const whole = new Float32Array(2 + 7 * rows.length);
  whole[0] = time;
  whole.set(rows.flat(), 2);
  return whole.buffer;
}

it("has the last two instants, and what moved between them", () => {
  const scene = {
    machine: { blocks: [block, { ...block, id: "2" }], connectors: [], modules: {}, controller: "" },
    scenario: {
      duration_s: 10,
      terrain: [],
      cargo: { size: [1, 1, 1], drop_height: 3, final_mass: 5 },
      placement: { kind: "ground" },
    },
  } as unknown as Parameters<typeof liveOf>[0];
  const live = liveOf(scene);
  const level = [1, 0, 0, 0];
  takeFrame(live, frame(0, [0, 0, 1, ...level], [0, 1, 1, ...level], [0, 0, 5, ...level]), 1);
  expect(motionOf(live)).toEqual({ height: 1, speed: 0 });
  takeFrame(live, frame(0.04, [0, 0.2, 1.5, ...level], [0, 1, 1, ...level], [0, 0, 4, ...level]), 41);
  expect(live.time).toBeCloseTo(0.04);
  expect([...live.trial.positions].slice(0, 3)).toEqual([0, 0, 1]);
  expect(live.trial.positions[7]).toBeCloseTo(0.2);
  expect([live.trial.cargo?.positions[2], live.trial.cargo?.positions[5]]).toEqual([5, 4]);
  expect([...live.trial.quaternions]).toEqual([...level, ...level, ...level, ...level]);
  expect(motionOf(live).speed).toBeCloseTo(Math.hypot(0.2, 0.5) / 0.04);
});
