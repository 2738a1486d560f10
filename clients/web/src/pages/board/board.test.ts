import { describe, expect, it } from "vitest";
import { exportPath } from "./Exports";
import { readSearch } from "../../api/board-search";
import { jobsBehind } from "../../parts/jobs-behind";

describe("readSearch", () => {
  it("reads every switch, and one task as a list", () => {
    const raw = { track: "t", task: "lift-1", baselines: "no" };
    expect(readSearch(raw)).toMatchObject({ ...raw, task: ["lift-1"] });
  });

  it.each([{ task: [1, null, ""] }, { baselines: {} }, { track: 7 }])("drops what makes no sense: %j", (raw) => {
    expect(Object.values(readSearch(raw)).filter((value) => value !== undefined)).toEqual([]);
  });
});

it("exports ask for exactly what is shown", () => {
  const path = exportPath("a/b&c", { task: ["x", "y"], baselines: "no" }, "csv");
  const words = new URL(path, "http://here").searchParams;
  expect(words.getAll("task")).toEqual(["x", "y"]);
  expect(words.get("track")).toBe("a/b&c");
  expect(words.has("baselines")).toBe(false);
});

it("a cell opens exactly the jobs that the service names", () => {
  const jobs = "/v1/jobs?task=a%26b&model=builtin%2Fx&track=t%2F1&task_version=v&configuration=c";
  expect(jobsBehind({ jobs })).toEqual({
    ...{ task: "a&b", model: "builtin/x", track: "t/1", task_version: "v", configuration: "c", state: "done" },
  });
});
