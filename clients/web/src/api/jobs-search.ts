import type { JobFilters } from "./queries";

const TEXTS = [
  ...(["task", "model", "sweep", "state", "outcome", "reason", "flag"] as const),
  ...(["track", "task_version", "configuration", "text"] as const),
] as const;
const SORTS = ["created", "finished", "indicator", "cost"] as const;

/** What the address of a list of jobs says. */
export type JobsSearch = Pick<JobFilters, (typeof TEXTS)[number] | "category" | "sort" | "order">;

/** Reads an address; the API refuses what no job can have, and says what would be valid. */
export function readJobsSearch(raw: Record<string, unknown>): JobsSearch {
  // An address may spell a text like a number: "text=5".
  const texts = TEXTS.flatMap((name) => {
    const value = typeof raw[name] === "number" ? String(raw[name]) : raw[name];
    return typeof value === "string" && value !== "" ? [[name, value]] : [];
  });
  const categories = (Array.isArray(raw.category) ? raw.category : [raw.category]).filter(
    (one) => typeof one === "string" && one !== "",
  );
  return {
    ...(Object.fromEntries(texts) as JobsSearch),
    ...(categories.length > 0 ? { category: categories as string[] } : {}),
    ...(SORTS.some((sort) => sort === raw.sort) ? { sort: raw.sort as JobsSearch["sort"] } : {}),
    ...(raw.order === "asc" ? { order: "asc" } : {}),
  };
}

const VIEWS = ["transcript", "building", "measurements", "files"] as const;

/** What the address of a job says: how far it is built, which part is chosen, what is shown below the machine. */
export interface JobSearch {
  step?: number;
  part?: string;
  view?: (typeof VIEWS)[number];
  /** Seconds of the trial that is shown. */
  t?: number;
  /** The number of the rollout that is shown. */
  rollout?: number;
  /** The turn of the transcript that is shown first. */
  turn?: number;
  /** From where it is seen, see `writtenLook`. */
  camera?: string;
}

export function readJobSearch(raw: Record<string, unknown>): JobSearch {
  const step = typeof raw.step === "number" ? Math.floor(raw.step) : NaN;
  const part = typeof raw.part === "number" ? String(raw.part) : raw.part;
  return {
    step: step >= 0 && Number.isSafeInteger(step) ? step : undefined,
    part: typeof part === "string" && part.length < 100 ? part : undefined,
    view: VIEWS.find((view) => view === raw.view),
    t: typeof raw.t === "number" && raw.t >= 0 && Number.isFinite(raw.t) ? raw.t : undefined,
    rollout: typeof raw.rollout === "number" && Number.isSafeInteger(raw.rollout) ? raw.rollout : undefined,
    turn: typeof raw.turn === "number" && Number.isSafeInteger(raw.turn) && raw.turn >= 0 ? raw.turn : undefined,
    camera: typeof raw.camera === "string" && raw.camera.length < 100 ? raw.camera : undefined,
  };
}
