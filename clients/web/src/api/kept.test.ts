import { describe, expect, it } from "vitest";
import { keyOf } from "./site-cache";
import { listed, summed, type Rows } from "./site-jobs";

describe("keyOf", () => {
  const key = (address: string): string => keyOf(new URL(address, "http://here/some/where/"));

  it("is the spelling of a site's index: decoded, the parameters in order", () => {
    expect(key("/v1/leaderboard")).toBe("/v1/leaderboard");
    expect(key("/v1/leaderboard?track=a%2Fb&model=m")).toBe("/v1/leaderboard?model=m&track=a/b");
    expect(key("/v1/leaderboard?task=b&task=a")).toBe("/v1/leaderboard?task=a&task=b");
    expect(key("/v1/leaderboard/compare?first=x+y%26z")).toBe("/v1/leaderboard/compare?first=x y&z");
    expect(key("/v1/jobs/j/artifacts/a%20b")).toBe("/v1/jobs/j/artifacts/a b");
  });
});

describe("listed", () => {
  const job = (id: string, change: object): object => ({
    id,
    task: "t",
    model: "m",
    created_at: "2026-01-01T00:00:00Z",
    finished_at: null,
    indicator: null,
    flags: [],
    reason: null,
    detail: null,
    usage: { cost_usd: null },
    ...change,
  });
  const rows = {
    jobs: [
      job("a", { indicator: 1, finished_at: "2026-01-01T00:00:00.100000Z" }),
      job("b", { finished_at: "2026-01-01T00:00:00Z" }),
      job("c", { indicator: 3, finished_at: "2026-01-01T00:00:00.000001Z", flags: ["odd"], detail: "It FELL" }),
      job("d", { indicator: 1 }),
    ],
    kept: [],
    sweeps: { s: [2, 0] },
  } as unknown as Rows;
  const ids = (words: string): string =>
    listed(rows, new URLSearchParams(words))
      .data.map((one) => one.id)
      .join("");

  it("counts, bounds and sorts as the service does", () => {
    const more = {
      ...rows,
      jobs: [
        job("a", { state: "done", outcome: "limit", reason: "tokens", usage: { cost_usd: 2 }, flags: ["odd"] }),
        job("b", { state: "done", outcome: "limit", reason: "tokens", usage: { cost_usd: 1 }, task: "u" }),
        job("c", { state: "queued", outcome: null }),
      ],
    } as unknown as Rows;
    const ids = (words: string): string[] =>
      listed(more, new URLSearchParams(words), new Map([["k", new Set(["u"])]])).data.map((one) => one.id);
    expect(ids("category=k")).toEqual(["b"]);
    expect(ids("sort=cost&order=asc").at(-1)).toBe("c");
    const counted = summed(more, new URLSearchParams(""));
    expect(counted.endings).toEqual([
      { state: "done", outcome: "limit", reason: "tokens", jobs: 2 },
      { state: "queued", outcome: null, reason: null, jobs: 1 },
    ]);
    expect([counted.jobs, counted.flags]).toEqual([3, { odd: 1 }]);
    expect(summed(more, new URLSearchParams("reason=x")).jobs).toBe(0);
  });

  it("has jobs without a figure last, in both directions, and equal ones by their ids in the direction asked for", () => {
    expect(ids("sort=indicator")).toBe("cdab");
    expect(ids("sort=indicator&order=asc")).toBe("adcb");
    expect(ids("sort=finished&order=asc")).toBe("bcad");
    expect(ids("sort=created")).toBe("dcba");
  });

  it("chooses by what the address says", () => {
    expect(ids("sweep=s")).toBe("ca");
    expect(ids("sweep=unknown")).toBe("");
    expect(ids("flag=odd")).toBe("c");
    expect(ids("text=fell")).toBe("c");
  });

  it("continues from page to page, and ends", () => {
    const first = listed(rows, new URLSearchParams("limit=3"));
    expect(first.next_cursor).toBe("3");
    const last = listed(rows, new URLSearchParams("limit=3&cursor=3"));
    expect([last.data.map((one) => one.id), last.next_cursor]).toEqual([["a"], null]);
  });
});
