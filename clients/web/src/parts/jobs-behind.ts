import type { BoardSearch } from "../api/board-search";
import { readJobsSearch, type JobsSearch } from "../api/jobs-search";
import type { Row } from "../api/queries";

/** The jobs that a row counts, as the address of a list: the service says which, the board's days bound them. */
export function jobsBehind(row: Pick<Row, "jobs">, search: Pick<BoardSearch, "since" | "until">): JobsSearch {
  const words = new URL(row.jobs, "http://here").searchParams;
  const days = {
    since: search.since === undefined ? undefined : `${search.since}T00:00:00Z`,
    until: search.until === undefined ? undefined : `${search.until}T00:00:00Z`,
  };
  return readJobsSearch({ ...Object.fromEntries(words), state: "done", ...days });
}
