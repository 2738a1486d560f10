import { readJobsSearch, type JobsSearch } from "../api/jobs-search";
import type { Row } from "../api/queries";

/** The jobs that a row counts, as the address of a list: the service says which. */
export function jobsBehind(row: Pick<Row, "jobs">): JobsSearch {
  const words = new URL(row.jobs, "http://here").searchParams;
  return readJobsSearch({ ...Object.fromEntries(words), state: "done" });
}
