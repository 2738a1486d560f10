import { describe, expect, it } from "vitest";
import { refusal, headline, ApiError } from "./api/problem";
import { readEvent } from "./api/events";
import { bytes, dollars, duration, measured, moment, number, percent, places, trackLabel } from "./format";
import { chosenTurns, callLine, type Turn } from "./pages/job/transcript";
import { goalOf } from "./pages/tasks/goal";

describe("figures", () => {
  it("say when there is none", () => {
    for (const shown of [number(null), number(NaN), percent(undefined), dollars(null), duration(null), places(null, 2)])
      expect(shown).toBe("–");
  });

  it("keep small amounts visible and large ones readable", () => {
    expect(dollars(0.0042)).toBe("$0.0042");
    expect(dollars(0)).toBe("$0.00");
    expect(number(13136.6)).toBe("13,137");
    expect(number(0.0042)).toBe("0.004");
    expect(bytes(2048)).toBe("2.0 KiB");
    expect(duration(3725)).toBe("1 h 2 min");
    expect(places(1, 1)).toBe("1");
  });

  it("have units that can be read aloud", () => {
    expect(measured("nearness", "1/units")).toBe("nearness, per unit");
    expect(measured("time_at_height", "s")).toBe("time at height, s");
    expect(measured("glide_ratio", "1")).toBe("glide ratio");
  });

  it("leave a strange track as it is", () => {
    expect(trackLabel("external")).toBe("external");
    expect(trackLabel("five-role/pybullet-3/default-c562cad3-2")).toContain("pybullet 3");
  });
});

describe("problems", () => {
  it("are given in the service's words", () => {
    const error = refusal(422, { status: 422, title: "Unprocessable", detail: "tasks[0]: no such task", errors: [] });
    expect(error.message).toBe("tasks[0]: no such task");
    expect(error.passing).toBe(false);
    expect(refusal(502, "<html>").message).toContain("502");
    expect(headline(new ApiError(0, null, ""))).toBe("The service does not answer");
  });

  it("in a stream are skipped", () => {
    expect(readEvent("3", "done", "{")).toBeNull();
    expect(readEvent("3", "done", '{"job_id":"j","at":"t"}')).toMatchObject({ id: 3, kind: "done", job_id: "j" });
  });
});

const turn = (index: number, change: Partial<Turn>): Turn => ({
  index,
  stage: "build",
  sub_structure: null,
  role: "builder",
  text: "",
  actions: [],
  ...change,
});
const refused = {
  name: "attach_block_to",
  arguments: { base: "1" },
  ok: false,
  reason: "overlap",
  feedback: "It OVERLAPS block 3",
};

describe("turns", () => {
  const turns = [turn(0, { role: "planner", text: "A bridge" }), turn(1, { actions: [refused] }), turn(2, {})];
  const all = { role: null, refusedOnly: false, text: "" };

  it("are chosen by role, refusals and text, also of feedback", () => {
    const chosen = (filter: Partial<typeof all> | { role: string }) =>
      chosenTurns(turns, { ...all, ...filter }).map((one) => one.index);
    expect(chosen({})).toEqual([0, 1, 2]);
    expect(chosen({ role: "planner" })).toEqual([0]);
    expect(chosen({ refusedOnly: true })).toEqual([1]);
    expect(chosen({ text: " overlaps " })).toEqual([1]);
  });

  it("show calls whatever their arguments are", () => {
    expect(callLine(refused)).toBe('attach_block_to(base="1")');
    expect(callLine({ ...refused, arguments: [1] })).toBe("attach_block_to(0=1)");
    expect(callLine({ ...refused, arguments: null })).toBe("attach_block_to(null)");
  });
});

describe("goalOf", () => {
  it("finds the goal, or falls back to the whole", () => {
    expect(goalOf("# T\n\n**Goal.** Carry\nit.\n\n**Rules.** x")).toBe("Carry it.");
    expect(goalOf("Build  it")).toBe("Build it");
  });
});

it("a date is unmistakable", () => {
  expect(moment("2026-11-05T12:00:00Z")).toMatch(/5 Nov 2026, \d\d:\d\d/);
});
