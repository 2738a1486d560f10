import { Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link } from "@tanstack/react-router";
import type { BoardSearch } from "../../api/board-search";
import { board as boardQuery, jobSummary, tasks as tasksQuery, type Board, type JobFilters } from "../../api/queries";
import { isSite } from "../../api/site";
import { counted } from "../../format";
import { Collapsible } from "../../parts/Collapsible";
import { Answered, Empty } from "../../parts/States";
import { scoped } from "../compare/search";
import { entriesOf, namesOf } from "./entries";
import { Exports } from "./Exports";
import { Filters } from "./Filters";
import { HeatMap } from "./HeatMap";
import { Overall } from "./Overall";
import { scopeOf, scopesOf } from "./scope";

const route = getRouteApi("/");

/** The leaderboard of one track: a sentence, the table, and the rest on demand. */
export default function BoardPage() {
  const search = route.useSearch();
  const query = useQuery(boardQuery(search));
  const tasks = useQuery(tasksQuery()).data ?? [];
  const scope = scopeOf(search, scopesOf(tasks));
  return (
    <Stack gap="sm">
      <div>
        <Title order={1}>
          {scope.key === "" ? "Which model builds machines that work?" : `Leaderboard: ${scope.label}`}
        </Title>
        {query.data !== undefined && <Verdict board={query.data} search={search} />}
      </div>
      <Filters search={search} tasks={tasks} board={query.data} />
      <Answered query={query} rows={12}>
        {(found) =>
          found.track === null || found.overall.length === 0 ? (
            <Empty title="No run has ended yet">
              Choose other tasks or another protocol, or start one: <code>buildarena sweep run</code>
            </Empty>
          ) : (
            <Found board={found} track={found.track} search={search} />
          )
        }
      </Answered>
    </Stack>
  );
}

/** Who is best, and whether it is real: by the same tests as the table beneath. */
function Verdict({ board, search }: { board: Board; search: BoardSearch }) {
  const open = useOpenJobs(board.track, search);
  return (
    <Text role="status">
      {board.verdict?.sentence}
      {open !== null && open.jobs > 0 && (
        <>
          {" "}
          <Link to="/jobs" search={open.filters}>
            {counted(open.jobs, "run")}
          </Link>{" "}
          still going.
        </>
      )}
    </Text>
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

function Found({ board, track, search }: { board: Board; track: string; search: BoardSearch }) {
  const entries = entriesOf(board, search.baselines !== "no");
  const names = namesOf(board);
  const [first, second] = entries.flatMap(({ key }) => names.get(key) ?? []);
  const scope = isSite ? { track } : { ...scoped(search), track };
  return (
    <>
      <Overall board={board} entries={entries} scope={{ track, category: search.category }} />
      <Group gap="md">
        {first !== undefined && second !== undefined && (
          <Link to="/compare" search={{ models: `${first},${second}`, ...scope }}>
            Compare models
          </Link>
        )}
        <Link to="/method">Method</Link>
        <Exports track={track} search={search} />
      </Group>
      <Collapsible title="More: success on each task">
        <HeatMap board={board} entries={entries} />
      </Collapsible>
    </>
  );
}
