import type { ServiceEvent } from "../../api/events";
import type { Job, Sweep } from "../../api/queries";

const STATES: Readonly<Record<string, Job["state"]>> = {
  queued: "queued",
  running: "running",
  on_hold: "on_hold",
  done: "done",
};

/** The last thing that is known to have happened to a job, by the service's clock. */
function knownAt(job: Job): number {
  const times = [job.created_at, job.started_at, job.finished_at];
  return Math.max(...times.map((time) => (time === null ? 0 : Date.parse(time))));
}

/** A job after an event, or null when that says nothing new. */
export function changed(job: Job, event: ServiceEvent): Job | null {
  const state = STATES[event.kind];
  // A stream begins with what happened a while ago: that never takes back what was read since.
  if (state === undefined || Date.parse(event.at) < knownAt(job)) return null;
  if (state === "done") {
    if (job.state === "done") return null;
    const outcome = typeof event.data.outcome === "string" ? event.data.outcome : null;
    const reason = typeof event.data.reason === "string" ? event.data.reason : null;
    return { ...job, state, outcome: outcome as Job["outcome"], reason, finished_at: event.at };
  }
  const stage = event.data.stage === "simulate" ? "simulate" : "construct";
  if (job.state === state && job.stage === stage) return null;
  return { ...job, state, stage, outcome: null, finished_at: null };
}

export interface CellCounts {
  total: number;
  counts: ReadonlyMap<string, number>;
}

/** A moment of a sweep. Its jobs and cells are those of the sweep itself: read, never changed. */
export interface Moment {
  jobs: readonly Job[];
  cells: ReadonlyMap<string, ReadonlyMap<string, CellCounts>>;
  totals: ReadonlyMap<string, number>;
  tasks: readonly string[];
}

function standing(job: Job): string {
  return job.outcome ?? job.state;
}

/**
 * The jobs of a sweep, kept true by events: each costs as much as it changes, whatever the size of the sweep.
 */
export class LiveJobs {
  private readonly jobs: Job[] = [];
  private readonly places = new Map<string, number>();
  private readonly cells = new Map<string, Map<string, { total: number; counts: Map<string, number> }>>();
  private readonly totals = new Map<string, number>();
  private readonly tasks = new Set<string>();

  /** Takes in jobs as they were read; what events have said since stays. */
  add(read: readonly Job[]): void {
    for (const job of read) {
      const place = this.places.get(job.id);
      const before = place === undefined ? undefined : this.jobs[place];
      if (place === undefined || before === undefined) {
        this.places.set(job.id, this.jobs.push(job) - 1);
        this.count(job, 1);
      } else if (knownAt(job) >= knownAt(before)) {
        this.replace(place, before, job);
      }
    }
  }

  /** Takes in events; the number of jobs that ended by them. */
  apply(events: readonly ServiceEvent[]): number {
    let ended = 0;
    for (const event of events) {
      const place = event.job_id === null ? undefined : this.places.get(event.job_id);
      const before = place === undefined ? undefined : this.jobs[place];
      if (place === undefined || before === undefined) continue;
      const after = changed(before, event);
      if (after === null) continue;
      this.replace(place, before, after);
      if (after.state === "done") ended += 1;
    }
    return ended;
  }

  moment(): Moment {
    return {
      jobs: this.jobs,
      cells: this.cells,
      totals: this.totals,
      tasks: [...this.tasks].sort(),
    };
  }

  private replace(place: number, before: Job, after: Job): void {
    this.count(before, -1);
    this.jobs[place] = after;
    this.count(after, 1);
  }

  private count(job: Job, by: 1 | -1): void {
    const name = standing(job);
    const row = this.cells.get(job.model) ?? new Map<string, { total: number; counts: Map<string, number> }>();
    this.cells.set(job.model, row);
    const cell = row.get(job.task) ?? { total: 0, counts: new Map<string, number>() };
    row.set(job.task, cell);
    cell.total += by;
    for (const counts of [cell.counts, this.totals]) {
      const n = (counts.get(name) ?? 0) + by;
      if (n === 0) counts.delete(name);
      else counts.set(name, n);
    }
    this.tasks.add(job.task);
  }
}

/** What can be done with a sweep in its state. */
export function possible(state: Sweep["state"]): readonly ("pause" | "resume" | "cancel")[] {
  if (state === "active") return ["pause", "cancel"];
  if (state === "paused" || state === "budget_exhausted") return ["resume", "cancel"];
  return [];
}
