import type { BoardSearch } from "../api/board-search";
import { readJobsSearch, type JobsSearch } from "../api/jobs-search";
import type { Row } from "../api/queries";

type Days = Pick<BoardSearch, "since" | "until">;

function daysOf(search: Days): Days {
  return {
    since: search.since === undefined ? undefined : `${search.since}T00:00:00Z`,
    until: search.until === undefined ? undefined : `${search.until}T00:00:00Z`,
  };
}

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
    ...daysOf(search),
  });
}

/** The jobs that a row counts, as the address of a list: the service says which, the board's days bound them. */
export function jobsBehind(row: Pick<Row, "jobs">, search: Days): JobsSearch {
  const words = new URL(row.jobs, "http://here").searchParams;
  return readJobsSearch({ ...Object.fromEntries(words), state: "done", ...daysOf(search) });
}
