import type { JobFilters } from "./queries";

const NAMES = [
  ...(["task", "model", "sweep", "state", "outcome", "reason", "flag"] as const),
  ...(["track", "task_version", "configuration", "since", "until"] as const),
] as const;

/** What the address of a list of jobs says. */
export type JobsSearch = Pick<JobFilters, (typeof NAMES)[number]>;

/** Reads an address; the API refuses what no job can have, and says what would be valid. */
export function readJobsSearch(raw: Record<string, unknown>): JobsSearch {
  const found = NAMES.flatMap((name) => {
    const value = raw[name];
    return typeof value === "string" && value !== "" ? [[name, value]] : [];
  });
  return Object.fromEntries(found) as JobsSearch;
}

/** What the address of a job says: how far it is built, which part is chosen, or that the trial is shown. */
export interface JobSearch {
  step?: number;
  part?: string;
  view?: "trial";
  /** Seconds of the trial that is shown. */
  t?: number;
  /** The number of the rollout that is shown. */
  rollout?: number;
  /** From where it is seen, see `writtenLook`. */
  camera?: string;
}

export function readJobSearch(raw: Record<string, unknown>): JobSearch {
  const step = typeof raw.step === "number" ? Math.floor(raw.step) : NaN;
  const part = typeof raw.part === "number" ? String(raw.part) : raw.part;
  return {
    step: step >= 0 && Number.isSafeInteger(step) ? step : undefined,
    part: typeof part === "string" && part.length < 100 ? part : undefined,
    view: raw.view === "trial" ? "trial" : undefined,
    t: typeof raw.t === "number" && raw.t >= 0 && Number.isFinite(raw.t) ? raw.t : undefined,
    rollout: typeof raw.rollout === "number" && Number.isSafeInteger(raw.rollout) ? raw.rollout : undefined,
    camera: typeof raw.camera === "string" && raw.camera.length < 100 ? raw.camera : undefined,
  };
}
