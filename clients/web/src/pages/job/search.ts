import type { JobFilters } from "../../api/queries";

/** What the address of a list of jobs says. */
export type JobsSearch = Pick<JobFilters, "task" | "model" | "sweep" | "state" | "outcome" | "reason" | "flag">;

const NAMES = ["task", "model", "sweep", "state", "outcome", "reason", "flag"] as const;

/** Reads an address; the API refuses what no job can have, and says what would be valid. */
export function readJobsSearch(raw: Record<string, unknown>): JobsSearch {
  const found = NAMES.flatMap((name) => {
    const value = raw[name];
    return typeof value === "string" && value !== "" ? [[name, value]] : [];
  });
  return Object.fromEntries(found) as JobsSearch;
}
