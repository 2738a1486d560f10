import { describe, expect, it } from "vitest";
import type { PartView } from "../../scene/machine";
import { differing } from "../compare/ComparedModels";
import type { Job } from "../../api/queries";
import { toldIn } from "./live";
import { rolloutsOf } from "./queries";
import { builtAt, ghostsOf, isWhole, placesOf, rangeOf, stepsOf, touchedBy, withTurns, type Replay } from "./replay";
import { readJobSearch } from "../../api/jobs-search";
import type { Turn } from "./transcript";

type StepView = Replay["chapters"][number]["steps"][number];

const part = (id: string, x = 0): PartView => ({
  id,
  module: "Small Wooden Block",
  position: [x, 0, 0],
  quaternion: [1, 0, 0, 0],
  start: null,
  end: null,
  flipped: false,
  bindings: {},
});
const step = (change: Partial<StepView>): StepView => ({
  turn: 0,
  action: "attach_block_to",
  arguments: {},
  accepted: true,
  reason: null,
  text: null,
  added: [],
  moved: [],
  removed: [],
  rebound: [],
  control_sequence: null,
  attempted: [],
  ...change,
});
const REPLAY: Replay = {
  complete: true,
  exact: true,
  chapters: [
    {
      name: "leg",
      kind: "sub_structure",
      steps: [
        step({ action: "start", added: [part("1")] }),
        step({ turn: 1, added: [part("2", 1)] }),
        step({
          turn: 1,
          accepted: false,
          reason: "overlap",
          attempted: [{ id: "3", module: "Torch", position: [9, 0, 0], quaternion: [1, 0, 0, 0] }],
        }),
        step({ turn: 2, action: "shift_block", moved: [part("2", 5)] }),
        step({ turn: 3, action: "remove_block", removed: ["2"] }),
      ],
    },
    {
      name: "assembly",
      kind: "assembly",
      steps: [
        step({ turn: 4, action: "add_machine", added: [part("A1"), part("A2")] }),
        step({ turn: null, action: "review", added: [] }),
      ],
    },
  ],
};
const turn = (index: number, actions: [string, boolean][] = []): Turn => ({
  index,
  stage: "build",
  sub_structure: null,
  role: "builder",
  text: "",
  actions: actions.map(([name, ok]) => ({ name, ok, arguments: {}, reason: null, feedback: "" })),
});

describe("a replay", () => {
  const steps = stepsOf(REPLAY);

  it("builds step by step, each chapter from nothing", () => {
    const ids = (at: number) => [...builtAt(steps, at).parts.keys()];
    expect([-1, 0, 1, 2, 3, 4, 5].map(ids)).toEqual([
      [],
      ["1"],
      ["1", "2"],
      ["1", "2"],
      ["1", "2"],
      ["1"],
      ["A1", "A2"],
    ]);
    expect(builtAt(steps, 3).parts.get("2")?.position).toEqual([5, 0, 0]);
    expect(builtAt(steps, 3).madeBy.get("2")).toBe(1);
    expect([rangeOf(steps, 0), rangeOf(steps, 1), rangeOf(steps, 2)]).toEqual([[0, 4], [5, 6], null]);
  });

  it("shows only what a refused action would have placed", () => {
    expect(ghostsOf(steps[2]).map((ghost) => ghost.id)).toEqual(["3"]);
    expect(ghostsOf(steps[1])).toEqual([]);
    expect([...touchedBy(steps[3])]).toEqual(["2"]);
  });

  it("finds each step's action in the transcript, also where actions are not steps", () => {
    const turns = [
      turn(0, [["start", true]]),
      turn(1, [
        ["get_machine_summary", true],
        ["attach_block_to", true],
        ["attach_block_to", false],
      ]),
      turn(2, [["shift_block", true]]),
      turn(4, []),
    ];
    expect(placesOf(steps, turns)).toEqual(["0:0", "1:1", "1:2", "2:0", "3:", "4:", null]);
  });
});

describe("live turns", () => {
  it("given twice or out of order are there once, in order", () => {
    const merged = withTurns([turn(0), turn(1)], [turn(2), turn(1, [["start", true]])]);
    expect(merged.map((one) => one.index)).toEqual([0, 1, 2]);
    expect(merged[1]?.actions.length).toBe(1);
    expect(isWhole(merged)).toBe(true);
    expect(isWhole(withTurns(merged, [turn(4)]))).toBe(false);
  });

  it("that were too long to be sent are read", () => {
    const event = (shortened: boolean) => ({
      id: 1,
      kind: "turn",
      job_id: "j",
      at: "",
      data: { turn: { ...turn(0), shortened } },
    });
    expect(toldIn([event(false)]).whole).toBe(true);
    expect(toldIn([event(false), event(true)]).whole).toBe(false);
    expect(toldIn([{ id: 1, kind: "done", job_id: "j", at: "", data: {} }])).toEqual({ turns: [], whole: true });
  });
});

describe("addresses", () => {
  it.each([
    [
      { step: 3, part: 7, view: "files" },
      { step: 3, part: "7", view: "files" },
    ],
    [{ step: -1, part: "x".repeat(200), view: "x" }, {}],
    [{ step: "3", part: null }, {}],
    [{ step: 1e300 }, {}],
    [{ step: NaN }, {}],
  ])("%j", (raw, wanted) => {
    expect(JSON.parse(JSON.stringify(readJobSearch(raw)))).toEqual(wanted);
  });

  it("know a job's trials, those that score it first", () => {
    const artifacts = {
      "trajectory-10": "a",
      "trajectory-2": "b",
      "trajectory-12": "c",
      machine: "d",
      "log-2.txt": "e",
    };
    const world = { success: true, indicator: 1, flags: [], explanation: "" };
    const worlds = [10, 12, 14].map((rollout) => ({ ...world, rollout, exact: rollout === 10 }));
    expect(rolloutsOf({ artifacts, worlds })).toEqual([10, 12, 2]);
  });
});

describe("what differs", () => {
  it("is given for jobs with one seed, task version and track alone", () => {
    const job = (id: string, seed: number, outcome: string, track = "t", version = "v") =>
      ({ id, seed, outcome, track, task: "x", task_version: version }) as Job;
    const first = [job("a", 0, "success"), job("b", 1, "success"), job("c", 2, "limit"), job("d", 3, "success")];
    const second = [
      job("e", 0, "limit"),
      job("f", 1, "success"),
      job("g", 2, "success", "other"),
      job("h", 3, "limit", "t", "w"),
    ];
    expect(differing(first, second, "t").map(([a, b]) => a.id + b.id)).toEqual(["ae"]);
  });
});
