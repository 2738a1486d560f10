import type { JobFilters } from "../../api/queries";

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
