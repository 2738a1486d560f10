import { gzipSync } from "node:zlib";
import { expect, test } from "vitest";
import { readGiven, trialOf, type GivenTrial } from "./given";

const base64 = (array: Float32Array | Float64Array): string => Buffer.from(array.buffer).toString("base64");

test("what a page carries is unpacked, markup and letters as they were", async () => {
  const given = {
    title: "</script><b>Brücke</b>",
    machine: { modules: {}, blocks: [], connectors: [] },
    scenario: null,
    trial: null,
  };
  expect(await readGiven(gzipSync(JSON.stringify(given)).toString("base64"))).toEqual(given);
});

test("arrays of a trial are read as they were written", () => {
  const given: GivenTrial = {
    times: base64(new Float64Array([0, 0.04])),
    block_ids: ["1"],
    positions: base64(new Float32Array([1, 2, 3, 4, 5, 6.5])),
    quaternions: base64(new Float32Array([1, 0, 0, 0, 1, 0, 0, 0])),
    cargo: {
      size: [1, 1, 1],
      positions: base64(new Float32Array(6)),
      quaternions: base64(new Float32Array(8)),
      mass: base64(new Float64Array([5, 7.25])),
    },
    joint_peaks: [],
    joint_loads: null,
    breaks: [],
    engine: "mujoco",
    engine_version: "3",
  };
  const trial = trialOf(given);
  expect([...trial.times]).toEqual([0, 0.04]);
  expect([...trial.positions]).toEqual([1, 2, 3, 4, 5, 6.5]);
  expect([...(trial.cargo?.mass ?? [])]).toEqual([5, 7.25]);
  expect(trial.loads).toBeNull();
});
