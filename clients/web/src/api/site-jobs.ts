import type { components } from "./contract";

type Job = components["schemas"]["Job"];
type JobPage = components["schemas"]["JobList"];
type JobSummary = components["schemas"]["JobSummary"];

/** The rows of a site's jobs, and which of them are kept with everything they made. */
export interface Rows {
  jobs: Job[];
  kept: string[];
  /** By sweep, the places of its jobs among all. */
  sweeps: Record<string, number[]>;
}

type Value = string | number | null;

const EQUAL: Readonly<Record<string, (job: Job) => Value>> = {
  task: (job) => job.task,
  task_version: (job) => job.task_version,
  model: (job) => job.model,
  configuration: (job) => job.configuration,
  track: (job) => job.track,
  state: (job) => job.state,
  outcome: (job) => job.outcome,
  reason: (job) => job.reason,
};

const SORTED: Readonly<Record<string, (job: Job) => Value>> = {
  created: (job) => job.created_at,
  finished: (job) => job.finished_at,
  indicator: (job) => job.indicator,
  cost: (job) => (job.state === "done" ? job.usage.cost_usd : null),
};

/** The names of the tasks of each category, for lists of a category's jobs. */
export type Categories = ReadonlyMap<string, ReadonlySet<string>>;

const TIMES = new Set(["created", "finished"]);

/** Times to the microsecond: browsers read them to the millisecond, and the rest is in the text. */
function compareTimes(a: string, b: string): number {
  const apart = Date.parse(a) - Date.parse(b);
  if (apart !== 0) return apart;
  const digits = (time: string): string => (/\.(\d+)/.exec(time)?.[1] ?? "").padEnd(6, "0");
  return digits(a) < digits(b) ? -1 : digits(a) > digits(b) ? 1 : 0;
}

function compare(a: Value, b: Value, by: string): number {
  if (TIMES.has(by)) return compareTimes(String(a), String(b));
  if (a === b) return 0;
  return (a ?? 0) < (b ?? 0) ? -1 : 1;
}

function holds(job: Job, words: URLSearchParams, categories: Categories): boolean {
  for (const [name, read] of Object.entries(EQUAL)) {
    const wanted = words.get(name);
    if (wanted !== null && read(job) !== wanted) return false;
  }
  const [flag, text] = [words.get("flag"), words.get("text")];
  if (flag !== null && !job.flags.includes(flag)) return false;
  const wanted = words.getAll("category");
  if (wanted.length > 0 && !wanted.some((name) => categories.get(name)?.has(job.task))) return false;
  return (
    text === null ||
    [job.id, job.task, job.model, job.reason, job.detail].some((one) => one?.toLowerCase().includes(text.toLowerCase()))
  );
}

const NONE: Categories = new Map();

function chosen(rows: Rows, words: URLSearchParams, categories: Categories): Job[] {
  const sweep = words.get("sweep");
  const all = sweep === null ? rows.jobs : (rows.sweeps[sweep] ?? []).flatMap((place) => rows.jobs[place] ?? []);
  return all.filter((job) => holds(job, words, categories));
}

/** What a list comes to, as the service counts it. */
export function summed(rows: Rows, words: URLSearchParams, categories: Categories = NONE): JobSummary {
  const jobs = chosen(rows, words, categories);
  const endings = new Map<string, JobSummary["endings"][number]>();
  const flags = new Map<string, number>();
  for (const { state, outcome, reason, flags: own } of jobs) {
    const key = JSON.stringify([state, outcome, reason]);
    const ending = endings.get(key) ?? { state, outcome, reason, jobs: 0 };
    endings.set(key, { ...ending, jobs: ending.jobs + 1 });
    for (const flag of own) flags.set(flag, (flags.get(flag) ?? 0) + 1);
  }
  return {
    jobs: jobs.length,
    all_counted: true,
    endings: [...endings.values()].sort((a, b) => b.jobs - a.jobs),
    flags: Object.fromEntries([...flags].sort((a, b) => b[1] - a[1])),
  };
}

/** A page of jobs, filtered and sorted as the service does it; a cursor is the place where it begins. */
export function listed(rows: Rows, words: URLSearchParams, categories: Categories = NONE): JobPage {
  const by = words.get("sort") ?? "created";
  const value = SORTED[by] ?? ((job: Job) => job.created_at);
  const sign = words.get("order") === "asc" ? 1 : -1;
  const found = chosen(rows, words, categories).sort((a, b) => {
    const [one, other] = [value(a), value(b)];
    // Jobs without such a figure come last, in both directions.
    if (one === null || other === null)
      return Number(one === null) - Number(other === null) || sign * (a.id < b.id ? -1 : 1);
    return sign * (compare(one, other, by) || (a.id < b.id ? -1 : 1));
  });
  const begin = Number(words.get("cursor") ?? 0);
  const end = begin + Number(words.get("limit") ?? 100);
  return { data: found.slice(begin, end), next_cursor: end < found.length ? String(end) : null };
}
