import { describe, expect, it } from "vitest";
import { exportPath } from "./Exports";
import { sharedRanks } from "../../parts/ranks";
import { drawnParts, partsOf } from "./Failures";
import { coloursOf } from "./palette";
import { spotOf } from "./Radar";
import { readSearch } from "../../api/board-search";
import { jobsBehind } from "../../parts/jobs-behind";
import { shade, shareOf } from "./shades";

describe("readSearch", () => {
  it("reads every switch, and one task as a list", () => {
    const raw = { track: "t", task: "lift-1", figure: "indicator", baselines: "no" };
    expect(readSearch(raw)).toMatchObject({ ...raw, task: ["lift-1"] });
  });

  it.each([{ task: [1, null, ""] }, { figure: {} }, { track: 7 }])("drops what makes no sense: %j", (raw) => {
    expect(Object.values(readSearch(raw)).filter((value) => value !== undefined)).toEqual([]);
  });
});

describe("exports", () => {
  it("ask for exactly what is shown", () => {
    const path = exportPath("a/b&c", { task: ["x", "y"], figure: "indicator" }, "csv");
    const words = new URL(path, "http://here").searchParams;
    expect(words.getAll("task")).toEqual(["x", "y"]);
    expect(words.get("track")).toBe("a/b&c");
    expect(words.has("figure")).toBe(false);
  });
});

describe("shares", () => {
  it("keep to 0 and 1 and grow with the value", () => {
    expect(shareOf(null, [1])).toBeNull();
    expect(shareOf(5, [5, 1, null])).toBe(1);
    expect(shareOf(0, [0])).toBe(0);
    expect(shareOf(1, [5])).toBeLessThan(shareOf(2, [5]) ?? 0);
    expect(shade(7).background).toBe(shade(1).background);
  });

  it("of ranks are found, and no rank is no tie", () => {
    expect([...sharedRanks([{ rank: 1 }, { rank: 1 }, { rank: 3 }, { rank: null }, { rank: null }])]).toEqual([1]);
  });
});

describe("drawings", () => {
  it("have each dimension on an axis of its own, the first on top", () => {
    expect(spotOf(0, 4, 1)).toEqual({ x: 0, y: 1 });
    expect(spotOf(1, 4, 0.5).x).toBeCloseTo(0.5);
    expect(spotOf(2, 4, 1).y).toBeCloseTo(-1);
  });
  it("share a model's jobs out completely, the most frequent first", () => {
    const parts = partsOf([
      { label: "a", counts: { one: 1, two_x: 3 } },
      { label: "b", counts: {} },
      { label: "c", counts: { one: 1 } },
    ]);
    expect(parts.map((part) => [part.label, part.name, part.share])).toEqual([
      ["a", "two x", 0.75],
      ["a", "one", 0.25],
      ["c", "one", 1],
    ]);
  });
});
describe("kinds in a drawing", () => {
  const many = partsOf([
    { label: "a", counts: { one: 9, two: 8, three: 7, four: 6, five: 5, six: 4, seven: 3, success: 1 } },
    { label: "b", counts: { one: 1 } },
  ]);

  it("begin with success, and are at most six and the others", () => {
    expect(many[0]?.name).toBe("success");
    const drawn = drawnParts(many);
    expect(new Set(drawn.map((part) => part.name)).size).toBe(7);
    expect(drawn.find((part) => part.name === "other")).toMatchObject({ label: "a", count: 7 });
    expect(drawn.filter((part) => part.label === "a").reduce((sum, part) => sum + part.share, 0)).toBeCloseTo(1);
    expect(drawnParts(many.slice(0, 3))).toEqual(many.slice(0, 3));
  });

  it("are the most frequent of all models, whoever stands first", () => {
    const rare = { one: 1, two: 1, three: 1, four: 1, five: 1, six: 1 };
    const drawn = drawnParts(
      partsOf([
        { label: "a", counts: rare },
        { label: "b", counts: { frequent: 50 } },
      ]),
    );
    expect(drawn.find((part) => part.label === "b")?.name).toBe("frequent");
    expect(drawn.filter((part) => part.name === "other")).toMatchObject([{ label: "a", count: 1 }]);
  });

  it("have a colour of their own wherever they stand", () => {
    const kinds = ["success", "unsuccessful", "construction failed: no plan"];
    const colours = coloursOf(kinds);
    expect(new Set(colours).size).toBe(3);
    for (const kind of kinds) expect(coloursOf([kind])[0]).toBe(colours[kinds.indexOf(kind)]);
    expect(new Set(coloursOf(["success", "a", "b", "c", "d", "e"])).size).toBe(6);
    expect(coloursOf(["other"])).toEqual(["#999999"]);
  });
});
describe("a cell", () => {
  it("opens exactly the jobs that the service names", () => {
    const jobs = "/v1/jobs?task=a%26b&model=builtin%2Fx&track=t%2F1&task_version=v&configuration=c";
    expect(jobsBehind({ jobs })).toEqual({
      ...{ task: "a&b", model: "builtin/x", track: "t/1", task_version: "v", configuration: "c", state: "done" },
    });
  });
});
