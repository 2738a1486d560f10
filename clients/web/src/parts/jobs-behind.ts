import type { BoardSearch } from "../api/board-search";
import { readJobsSearch, type JobsSearch } from "../api/jobs-search";
import type { Row } from "../api/queries";

/**
 * The jobs of a board's model that ended in one way ("limit: tokens"), as the address of a list; null where
 * a list can't be of just these, as the board is about several chosen tasks.
 */
export function jobsEndedSo(
  row: { model: string; configuration: string },
  ended: string,
  track: string | null,
  search: BoardSearch,
): JobsSearch | null {
  if ((search.task ?? []).length > 1) return null;
  const [outcome, ...reason] = ended.split(": ");
  return readJobsSearch({
    ...{ model: row.model, configuration: row.configuration, track, state: "done" },
    ...{ outcome, reason: reason.join(": "), task: search.task?.[0], category: search.category },
  });
}

/** The jobs that a row counts, as the address of a list: the service says which. */
export function jobsBehind(row: Pick<Row, "jobs">): JobsSearch {
  const words = new URL(row.jobs, "http://here").searchParams;
  return readJobsSearch({ ...Object.fromEntries(words), state: "done" });
}
