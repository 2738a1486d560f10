import { describe, expect, it } from "vitest";
import type { ServiceEvent } from "../../api/events";
import type { JobView } from "../../api/queries";
import { applyEvents, grid, possible, rate } from "./live";

function job(id: string, change: Partial<JobView> = {}): JobView {
  const fresh = { id, task: "lift-1", model: "m", state: "queued", stage: "construct", outcome: null };
  const times = { created_at: "2026-01-01T00:00:00Z", started_at: null, finished_at: null };
  return { ...fresh, ...times, ...change } as JobView;
}

function event(kind: string, at: string, data: Record<string, unknown> = {}): ServiceEvent {
  return { id: 1, kind, job: "a", at, data };
}

describe("applyEvents", () => {
  it("moves a job on", () => {
    const [after] = applyEvents([job("a")], [event("done", "2026-01-01T00:01:00Z", { outcome: "success" })]);
    expect(after).toMatchObject({ state: "done", outcome: "success", finished_at: "2026-01-01T00:01:00Z" });
  });

  it("never takes back what was read after the event", () => {
    const done = job("a", { state: "done", outcome: "success", finished_at: "2026-01-01T00:05:00Z" });
    const before = [done];
    const old = ["queued", "running"].map((kind) => event(kind, "2026-01-01T00:01:00Z", { stage: "construct" }));
    expect(applyEvents(before, old)).toBe(before);
  });

  it("follows a retry, which is newer than the end", () => {
    const errored = job("a", { state: "done", outcome: "errored", finished_at: "2026-01-01T00:05:00Z" });
    const [after] = applyEvents([errored], [event("queued", "2026-01-01T00:06:00Z", { stage: "simulate" })]);
    expect(after).toMatchObject({ state: "queued", stage: "simulate", outcome: null, finished_at: null });
  });

  it("leaves the array alone for strangers and unknown kinds", () => {
    const before = [job("b")];
    expect(applyEvents(before, [event("done", "2026-01-02T00:00:00Z")])).toBe(before);
    expect(applyEvents(before, [{ ...event("paused", "2026-01-02T00:00:00Z"), job: "b" }])).toBe(before);
    expect(applyEvents(before, [{ ...event("done", "2026-01-02T00:00:00Z"), job: null }])).toBe(before);
  });
});

describe("grid and rate", () => {
  it("counts by model, task and outcome", () => {
    const cell = grid([job("a", { outcome: "success" }), job("b"), job("c", { task: "lift-2" })]).get("m")?.get("lift-1");
    expect(cell?.total).toBe(2);
    expect(cell?.counts.get("success")).toBe(1);
    expect(cell?.counts.get("queued")).toBe(1);
  });

  it("says nothing about too few ends, and nothing is left when all ended", () => {
    expect(rate([job("a")])).toEqual({ perMinute: null, leftSeconds: null });
    const ends = [0, 10, 20].map((s) => job(`e${s}`, { state: "done", finished_at: `2026-01-01T00:00:${String(s).padStart(2, "0")}Z` }));
    expect(rate(ends)).toEqual({ perMinute: 6, leftSeconds: 0 });
    expect(rate([...ends, job("a"), job("b")]).leftSeconds).toBe(20);
  });

  it("offers what a state allows", () => {
    expect(possible("active")).toContain("pause");
    expect(possible("paused")).toContain("resume");
    expect(possible("cancelled")).toEqual([]);
    expect(possible("done")).toEqual([]);
  });
});
