import type { ServiceEvent } from "../../api/events";
import type { JobView, SweepView } from "../../api/queries";

const STATES: Readonly<Record<string, JobView["state"]>> = {
  queued: "queued",
  running: "running",
  on_hold: "on_hold",
  done: "done",
};

/** The last thing that is known to have happened to a job, by the service's clock. */
function knownAt(job: JobView): number {
  const times = [job.created_at, job.started_at, job.finished_at];
  return Math.max(...times.map((time) => (time === null ? 0 : Date.parse(time))));
}

function changed(job: JobView, event: ServiceEvent): JobView | null {
  const state = STATES[event.kind];
  // A stream begins with what happened long ago: that never takes back what was read since.
  if (state === undefined || Date.parse(event.at) < knownAt(job)) return null;
  if (state === "done") {
    const outcome = typeof event.data.outcome === "string" ? event.data.outcome : null;
    return { ...job, state, outcome: outcome as JobView["outcome"], finished_at: event.at };
  }
  const stage = event.data.stage === "simulate" ? "simulate" : "construct";
  if (job.state === state && job.stage === stage) return null;
  return { ...job, state, stage, outcome: null, finished_at: null };
}

/** The jobs after some events; the same array when nothing changed. */
export function applyEvents(jobs: readonly JobView[], events: readonly ServiceEvent[]): readonly JobView[] {
  const places = new Map(jobs.map((job, index) => [job.id, index]));
  const next = [...jobs];
  let any = false;
  for (const event of events) {
    const place = event.job === null ? undefined : places.get(event.job);
    const before = place === undefined ? undefined : next[place];
    if (place === undefined || before === undefined) continue;
    const after = changed(before, event);
    if (after === null) continue;
    next[place] = after;
    any = true;
  }
  return any ? next : jobs;
}

export interface CellCounts {
  total: number;
  counts: ReadonlyMap<string, number>;
}

/** Jobs by model and task, each cell by outcome or state. */
export function grid(jobs: readonly JobView[]): Map<string, Map<string, CellCounts>> {
  const models = new Map<string, Map<string, { total: number; counts: Map<string, number> }>>();
  for (const job of jobs) {
    const row = models.get(job.model) ?? new Map<string, { total: number; counts: Map<string, number> }>();
    models.set(job.model, row);
    const cell = row.get(job.task) ?? { total: 0, counts: new Map<string, number>() };
    row.set(job.task, cell);
    const name = job.outcome ?? job.state;
    cell.total += 1;
    cell.counts.set(name, (cell.counts.get(name) ?? 0) + 1);
  }
  return models;
}

export interface Rate {
  perMinute: number | null;
  leftSeconds: number | null;
}

const WINDOW_MS = 5 * 60_000;
const FEWEST = 3;

/** How fast jobs end, by those of the last five minutes before the newest end. */
export function rate(jobs: readonly JobView[]): Rate {
  const ends = jobs.flatMap((job) => (job.finished_at === null ? [] : [Date.parse(job.finished_at)]));
  const left = jobs.filter((job) => job.state !== "done").length;
  const newest = Math.max(...ends);
  const recent = ends.filter((end) => end > newest - WINDOW_MS);
  const span = newest - Math.min(...recent);
  if (recent.length < FEWEST || span <= 0) return { perMinute: null, leftSeconds: null };
  const perMs = (recent.length - 1) / span;
  return { perMinute: perMs * 60_000, leftSeconds: left === 0 ? 0 : left / perMs / 1000 };
}

/** What can be done with a sweep in its state. */
export function possible(state: SweepView["state"]): readonly ("pause" | "resume" | "cancel")[] {
  if (state === "active") return ["pause", "cancel"];
  if (state === "paused" || state === "budget_exhausted") return ["resume", "cancel"];
  return [];
}
