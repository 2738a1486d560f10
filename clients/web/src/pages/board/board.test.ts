import { describe, expect, it } from "vitest";
import { boardQuery } from "../../api/queries";
import { exportPath } from "./Exports";
import { sharedRanks } from "./Overall";
import { readSearch } from "./search";
import { shade, shareOf } from "./shades";

describe("readSearch", () => {
  it("reads every switch, and one task as a list", () => {
    const raw = { track: "t", task: "lift-1", reading: "published", since: "2026-01-02", figure: "cost", paper: "yes" };
    expect(readSearch(raw)).toMatchObject({ ...raw, task: ["lift-1"] });
  });

  it.each([{ reading: "mine" }, { since: "yesterday" }, { task: [1, null, ""] }, { figure: {} }, { track: 7 }])(
    "drops what makes no sense: %j",
    (raw) => {
      expect(Object.values(readSearch(raw)).filter((value) => value !== undefined)).toEqual([]);
    },
  );
});

describe("exports", () => {
  it("ask for exactly what is shown", () => {
    const path = exportPath("a/b&c", { task: ["x", "y"], reading: "published", figure: "cost" }, "csv");
    const words = new URL(path, "http://here").searchParams;
    expect(words.getAll("task")).toEqual(["x", "y"]);
    expect(words.get("track")).toBe("a/b&c");
    expect(words.get("reading")).toBe("published");
    expect(words.has("figure")).toBe(false);
  });

  it("send days with a zone", () => {
    expect(boardQuery({ since: "2026-01-02" })).toEqual({ since: "2026-01-02T00:00:00Z" });
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
