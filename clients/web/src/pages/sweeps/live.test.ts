import { describe, expect, it } from "vitest";
import type { ServiceEvent } from "../../api/events";
import type { Job } from "../../api/queries";
import { LiveJobs, possible } from "./live";

function job(id: string, change: Partial<Job> = {}): Job {
  const fresh = { id, task: "lift-1", model: "m", state: "queued", stage: "construct", outcome: null };
  const times = { created_at: "2026-01-01T00:00:00Z", started_at: null, finished_at: null };
  return { ...fresh, ...times, ...change } as Job;
}

function event(kind: string, at: string, data: Record<string, unknown> = {}, id = "a"): ServiceEvent {
  return { id: 1, kind, job_id: id, at, data };
}

function live(...jobs: Job[]): LiveJobs {
  const found = new LiveJobs();
  found.add(jobs);
  return found;
}

const done = job("a", { state: "done", outcome: "success", finished_at: "2026-01-01T00:05:00Z" });

describe("events", () => {
  it("move a job on, with the reason of its end", () => {
    const jobs = live(job("a"));
    expect(jobs.apply([event("done", "2026-01-01T00:01:00Z", { outcome: "limit", reason: "tokens" })])).toBe(1);
    expect(jobs.moment().jobs[0]).toMatchObject({
      state: "done",
      outcome: "limit",
      reason: "tokens",
      finished_at: "2026-01-01T00:01:00Z",
    });
  });

  it("never take back what was read after them, and count no end twice", () => {
    const jobs = live(done);
    const old = ["queued", "running", "done"].map((kind) =>
      event(kind, "2026-01-01T00:01:00Z", { stage: "construct" }),
    );
    expect(jobs.apply(old)).toBe(0);
    expect(jobs.apply([event("done", "2026-01-01T00:05:00Z", { outcome: "success" })])).toBe(0);
    expect(jobs.moment().jobs).toEqual([done]);
  });

  it("follow a retry, which is newer than the end", () => {
    const jobs = live({ ...done, outcome: "errored" });
    jobs.apply([event("queued", "2026-01-01T00:06:00Z", { stage: "simulate" })]);
    expect(jobs.moment().jobs[0]).toMatchObject({
      state: "queued",
      stage: "simulate",
      outcome: null,
      finished_at: null,
    });
    expect([...jobs.moment().totals]).toEqual([["queued", 1]]);
  });

  it("of strangers, of sweeps and of unknown kinds change nothing", () => {
    const jobs = live(job("b"));
    const strange = [event("done", "2026-01-02T00:00:00Z"), event("paused", "2026-01-02T00:00:00Z", {}, "b")];
    expect(jobs.apply([...strange, { ...event("done", "2026-01-02T00:00:00Z"), job_id: null }])).toBe(0);
    expect([...jobs.moment().totals]).toEqual([["queued", 1]]);
  });
});

describe("what is read", () => {
  it("completes what events said, and is no older than it", () => {
    const jobs = live(job("a"));
    jobs.apply([event("done", "2026-01-01T00:05:00Z", { outcome: "success" })]);
    jobs.add([job("a", { state: "running", started_at: "2026-01-01T00:01:00Z" })]);
    expect(jobs.moment().jobs[0]?.state).toBe("done");
    jobs.add([{ ...done, indicator: 7 }]);
    expect(jobs.moment().jobs).toHaveLength(1);
    expect(jobs.moment().jobs[0]?.indicator).toBe(7);
  });

  it("is counted by model, task and outcome, in step with what happens", () => {
    const jobs = live(done, job("b"), job("c", { task: "lift-2" }));
    const cell = (): [number, [string, number][]] => {
      const found = jobs.moment().cells.get("m")?.get("lift-1");
      return [found?.total ?? 0, [...(found?.counts ?? [])]];
    };
    expect(cell()).toEqual([
      2,
      [
        ["success", 1],
        ["queued", 1],
      ],
    ]);
    jobs.apply([event("running", "2026-01-01T00:01:00Z", { stage: "construct" }, "b")]);
    expect(cell()).toEqual([
      2,
      [
        ["success", 1],
        ["running", 1],
      ],
    ]);
    expect(jobs.moment().tasks).toEqual(["lift-1", "lift-2"]);
  });

  it("may be ten thousand jobs, and an event costs no more for it", () => {
    const jobs = live(...Array.from({ length: 10_000 }, (_, n) => job(`j${n}`, { task: `t${n % 9}` })));
    const ends = Array.from({ length: 10_000 }, (_, n) =>
      event("done", "2026-01-01T00:01:00Z", { outcome: "success" }, `j${n}`),
    );
    const start = performance.now();
    for (const end of ends) jobs.apply([end]);
    expect(performance.now() - start).toBeLessThan(1_000);
    expect([...jobs.moment().totals]).toEqual([["success", 10_000]]);
  });
});

it("a state offers what it allows", () => {
  expect(possible("active")).toContain("pause");
  expect(possible("paused")).toContain("resume");
  expect(possible("cancelled")).toEqual([]);
  expect(possible("done")).toEqual([]);
});
