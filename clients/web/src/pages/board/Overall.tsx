import { Badge, Button, Checkbox, Group, Table, Text } from "@mantine/core";
import { Link } from "@tanstack/react-router";
import type { Board, OverallRow } from "../../api/queries";
import { count, dollars, number, percent, places } from "../../format";
import { Interval } from "../../parts/Interval";
import { useState } from "react";
import { isSite } from "../../api/site";
import { scoped } from "../compare/search";
import { entriesOf, keyOf, namesOf } from "./entries";
import { SCORE, sharedRanks } from "../../parts/ranks";
import { SortHead, useSorting } from "../../parts/SortHead";
import { Tip } from "../../parts/Tip";
import type { Values } from "../../parts/sorting";
import type { BoardSearch } from "../../api/board-search";

type Entry = Pick<OverallRow, "rank" | "rank_low" | "rank_high" | "mean_rank" | "model">;

const VALUES: Values<OverallRow> = {
  model: (row) => row.model,
  rank: (row) => row.rank,
  mean: (row) => row.mean_rank,
  score: (row) => row.score_mean,
  success: (row) => row.success_rate_mean,
  cost: (row) => row.cost_usd_mean,
  tokens: (row) => row.output_tokens_mean,
  trials: (row) => row.counted,
};

/** Models ranked over all tasks of the board, with the intervals of their places. */
export function Overall({ board, search }: { board: Board; search: BoardSearch }) {
  const overall = board.overall.filter((row) => search.baselines !== "no" || !row.baseline);
  const labels = new Map(entriesOf(board, true).map((entry) => [entry.key, entry.label]));
  const most = Math.max(1, ...overall.map((row) => row.rank_high ?? 1));
  const { rows, head } = useSorting(overall, VALUES);
  const [ticked, setTicked] = useState<readonly string[]>([]);
  const names = namesOf(board);
  const tick = (key: string): void => {
    // A third takes the place of the first.
    setTicked(ticked.includes(key) ? ticked.filter((one) => one !== key) : [...ticked, key].slice(-2));
  };
  const ties = sharedRanks(overall);
  return (
    <>
      <Ticked models={ticked.flatMap((key) => names.get(key) ?? [])} board={board} search={search} />
      <Table.ScrollContainer minWidth={720} type="native">
        <Table verticalSpacing={7} className="sticky-first" highlightOnHover>
          <Table.Thead>
            <Table.Tr>
              <SortHead name="model" {...head}>
                Model
              </SortHead>
              <SortHead name="rank" figures {...head}>
                Rank
              </SortHead>
              <Table.Th>Place, 95 % interval</Table.Th>
              <SortHead name="mean" figures {...head}>
                Mean rank
              </SortHead>
              <SortHead name="score" figures title={SCORE} {...head}>
                Score
              </SortHead>
              <SortHead name="success" figures {...head}>
                Success, mean of tasks
              </SortHead>
              <SortHead name="cost" figures {...head}>
                $ a job
              </SortHead>
              <SortHead name="tokens" figures {...head}>
                Output tokens
              </SortHead>
              <SortHead name="trials" figures {...head}>
                Trials
              </SortHead>
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {rows.map((row) => (
              <OverallRow
                key={keyOf(row)}
                row={row}
                label={labels.get(keyOf(row)) ?? row.model}
                most={most}
                tied={row.rank !== null && ties.has(row.rank)}
                over={board.ranked.length}
                ticked={ticked.includes(keyOf(row))}
                onTick={() => {
                  tick(keyOf(row));
                }}
              />
            ))}
          </Table.Tbody>
        </Table>
      </Table.ScrollContainer>
    </>
  );
}

/** What ticked rows lead to, the board's scope with them: one is compared with the best of the others. */
function Ticked({ models, board, search }: { models: readonly string[]; board: Board; search: BoardSearch }) {
  const [first, ticked] = models;
  if (first === undefined) return null;
  const second = ticked ?? board.overall.find((row) => row.rank !== null && row.model !== first)?.model;
  if (second === undefined) return <Text size="sm">Tick a second model to compare it with {first}.</Text>;
  const scope = isSite ? { track: board.track ?? undefined } : { ...scoped(search), track: board.track ?? undefined };
  return (
    <Group gap="sm" mb="xs">
      <Button
        size="xs"
        renderRoot={(props) => <Link to="/compare" search={{ models: `${first},${second}`, ...scope }} {...props} />}
      >
        Compare {first} and {second}
      </Button>
      {ticked === undefined && <Text size="sm">or tick a second model</Text>}
    </Group>
  );
}

function Place({ row, most, tied }: { row: Entry; most: number; tied: boolean }) {
  const interval = places(row.rank_low, row.rank_high);
  return (
    <>
      <Table.Td className="figures">
        {row.rank === null ? (
          "–"
        ) : (
          <>
            {row.rank}
            {tied && (
              <Text span size="xs" ml={4} className="dimmed">
                <Tip label="Statistically tied: the trials do not show which is better">tied</Tip>
              </Text>
            )}
          </>
        )}
      </Table.Td>
      <Table.Td>
        <Group gap={8} wrap="nowrap">
          <Interval
            low={row.rank_low}
            high={row.rank_high}
            value={row.rank}
            from={1}
            to={most}
            label={`place ${interval}`}
          />
          <Text size="sm" className="figures" style={{ whiteSpace: "nowrap" }}>
            {interval}
          </Text>
        </Group>
      </Table.Td>
    </>
  );
}

interface RowOf {
  row: OverallRow;
  label: string;
  most: number;
  tied: boolean;
  /** How many tasks the ranking is over. */
  over: number;
  ticked: boolean;
  onTick: () => void;
}

function OverallRow({ row, label, most, tied, over, ticked, onTick }: RowOf) {
  return (
    <Table.Tr>
      <Table.Td>
        <Group gap={6} className="name-and-badges">
          <Group gap={6} wrap="nowrap">
            <Checkbox size="xs" checked={ticked} onChange={onTick} aria-label={`Compare ${label}`} />
            <Link className="quiet" to="/models/$" params={{ _splat: row.model }}>
              <b>{label}</b>
            </Link>
          </Group>
          {row.baseline && (
            <Badge variant="outline" color="gray" size="sm" tt="none" styles={{ root: { color: "inherit" } }}>
              baseline
            </Badge>
          )}
          {row.pareto && (
            <Badge variant="outline" size="sm" tt="none" styles={{ root: { color: "inherit" } }}>
              <Tip label="No other model is both better and cheaper">Pareto</Tip>
            </Badge>
          )}
        </Group>
        {row.missing.length > 0 && (
          <Text size="xs" className="dimmed">
            not ranked yet: {over - row.missing.length} of {over} tasks are in, none counted on {row.missing.join(", ")}
          </Text>
        )}
      </Table.Td>
      <Place row={row} most={most} tied={tied} />
      <Table.Td className="figures">{number(row.mean_rank, 2)}</Table.Td>
      <Table.Td className="figures">{number(row.score_mean, 2)}</Table.Td>
      <Table.Td className="figures">{percent(row.success_rate_mean, 1)}</Table.Td>
      <Table.Td className="figures">{dollars(row.cost_usd_mean)}</Table.Td>
      <Table.Td className="figures">{count(row.output_tokens_mean)}</Table.Td>
      <Table.Td className="figures">{count(row.counted)}</Table.Td>
    </Table.Tr>
  );
}
