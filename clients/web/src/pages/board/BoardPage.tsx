import { Anchor, Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link } from "@tanstack/react-router";
import { lazy, memo, Suspense, useDeferredValue, useMemo } from "react";
import { board, type Board } from "../../api/queries";
import { Later } from "../../parts/Later";
import { Section } from "../../parts/Section";
import { Answered, Empty, Loading } from "../../parts/States";
import { Controls } from "./Controls";
import { Exports } from "./Exports";
import { HeatMap } from "./HeatMap";
import { Overall } from "./Overall";
import { rankedOver, scopeOf } from "./scope";
import { ScopeChips } from "./ScopeChips";
import { Verdict } from "./Verdict";
import type { BoardSearch } from "../../api/board-search";

const BoardPlots = lazy(() => import("./BoardPlots"));
const route = getRouteApi("/");

/** The leaderboard of one track. */
export default function BoardPage() {
  const search = route.useSearch();
  const query = useQuery(board(search));
  const scope = scopeOf(search);
  return (
    <Stack gap="lg">
      <div>
        <Title order={1}>{scope.key === "" ? "Leaderboard" : `Leaderboard: ${scope.label}`}</Title>
        <Text size="sm" className="dimmed">
          Who builds machines that work? Each model builds every task several times; a simulator tries each machine.
        </Text>
      </div>
      <ScopeChips search={search} />
      <Answered query={query} rows={12}>
        {(found) => <Unhurried found={found} search={search} />}
      </Answered>
    </Stack>
  );
}

/** So few cells are made at once: each step of a board costs a paint. */
const FEW_CELLS = 60;

const isSmall = (board: Board): boolean => board.overall.length * board.tasks.length <= FEW_CELLS;

/** A board, made bit by bit: its thousands of cells would hold up what is pressed meanwhile. */
function Unhurried({ found, search }: { found: Board; search: BoardSearch }) {
  const now = useMemo(() => ({ found, search }), [found, search]);
  const later = useDeferredValue<typeof now | null>(now, isSmall(found) ? now : null);
  return later === null ? <Loading rows={12} /> : <Found {...later} />;
}

const Found = memo(function Found({ found, search }: { found: Board; search: BoardSearch }) {
  if (found.track === null) {
    return (
      <Empty title="No job has ended yet">
        Submit one with <code>buildarena sweep run</code>, or watch those that run on the{" "}
        <Anchor component={Link} to="/sweeps" inherit>
          sweeps page
        </Anchor>
        .
      </Empty>
    );
  }
  const now = isSmall(found);
  return (
    <>
      <Verdict board={found} search={search} />
      <Later rows={10} now={now}>
        <Controls board={found} search={search} />
        <Later rows={8} now={now}>
          <Section title="Overall" aside={<Exports track={found.track} search={search} />}>
            {found.overall.length === 0 ? (
              <Empty title="No job of these tasks has ended on this track">
                Choose other tasks above, or another track.
              </Empty>
            ) : (
              <>
                <Text size="sm" className="dimmed" mb="xs">
                  {rankedOver(found.ranked, found.tasks.length)}
                </Text>
                <Overall board={found} search={search} />
              </>
            )}
          </Section>
          <Later rows={8} now={now}>
            <Section title="Model by task">
              <HeatMap board={found} search={search} />
            </Section>
            <Later rows={8} now={now}>
              <Suspense fallback={<Loading rows={8} />}>
                <BoardPlots board={found} search={search} />
              </Suspense>
            </Later>
          </Later>
        </Later>
      </Later>
      <Group>
        <Text size="xs" className="dimmed">
          Intervals hold at 95 %. Places are given with the interval that holds them; models whose trials do not show
          which is better are tied and share a rank. <Link to="/method">How ranks and intervals come about</Link>
        </Text>
      </Group>
    </>
  );
});
