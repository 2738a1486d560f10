import { Alert, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import type { BoardSearch } from "../../api/board-search";
import { jobSummary, type Board, type JobFilters } from "../../api/queries";
import { isSite } from "../../api/site";
import { count } from "../../format";

/** Who is best, and whether it is real: by the same tests as the table beneath. */
export function Verdict({ board, search }: { board: Board; search: BoardSearch }) {
  const open = useOpenJobs(board.track, search);
  if (board.verdict == null) return null;
  return (
    <Alert variant="light" color={board.verdict.proven ? "teal" : "gray"} role="status" className="verdict">
      <Text fw={600}>{board.verdict.sentence}</Text>
      {open !== null && open.jobs > 0 && (
        <Text size="sm" mt={4}>
          Provisional:{" "}
          <Link to="/jobs" search={open.filters}>
            {count(open.jobs)} {open.jobs === 1 ? "job" : "jobs"}
          </Link>{" "}
          of this track {open.jobs === 1 ? "has" : "have"} not ended.
        </Text>
      )}
    </Alert>
  );
}

/** Jobs of the board that are still to come: waiting, or under way. */
function useOpenJobs(track: string | null, search: BoardSearch): { jobs: number; filters: JobFilters } | null {
  const filters: JobFilters = {
    track: track ?? undefined,
    category: search.category,
    task: search.task?.length === 1 ? search.task[0] : undefined,
  };
  const enabled = !isSite && track !== null;
  const waiting = useQuery({ ...jobSummary({ ...filters, state: "queued" }), enabled }).data;
  const running = useQuery({ ...jobSummary({ ...filters, state: "running" }), enabled }).data;
  if (!enabled || waiting === undefined || running === undefined) return null;
  const state = running.jobs > waiting.jobs ? "running" : "queued";
  return { jobs: waiting.jobs + running.jobs, filters: { ...filters, state } };
}
