import { Badge, Group, Table, Text } from "@mantine/core";
import { Link } from "@tanstack/react-router";
import type { Row, TaskBoard } from "../api/queries";
import { SCORE, sharedRanks } from "./ranks";
import { jobsBehind } from "./jobs-behind";
import { count, dollars, measured, number, percent, places, successes } from "../format";
import { Interval } from "./Interval";
import { SortHead, useSorting } from "./SortHead";
import type { Values } from "./sorting";

const VALUES: Values<Row> = {
  model: (row) => row.model,
  rank: (row) => row.rank,
  success: (row) => row.success_rate,
  indicator: (row) => row.indicator_mean,
  score: (row) => row.score,
  best: (row) => row.indicator_best,
  parts: (row) => row.parts_mean,
  cost: (row) => row.cost_per_success_usd,
  refused: (row) => row.refused_action_rate,
};

/** All models on one task, the best first. */
export function TaskTable({ task }: { task: TaskBoard }) {
  const ties = sharedRanks(task.rows);
  const { rows, head } = useSorting(task.rows, VALUES);
  const several = new Set(task.rows.map((row) => row.model)).size < task.rows.length;
  return (
    <Table.ScrollContainer minWidth={820} type="native">
      <Table highlightOnHover className="sticky-first" aria-label={`Models on ${task.task}`}>
        <Table.Thead>
          <Table.Tr>
            <SortHead name="model" {...head}>
              Model
            </SortHead>
            <SortHead name="rank" figures {...head}>
              Rank
            </SortHead>
            <Table.Th className="figures">Place</Table.Th>
            <SortHead name="success" figures {...head}>
              Success, 95 % interval
            </SortHead>
            <SortHead name="indicator" figures {...head}>
              {measured(task.indicator, task.unit)}
            </SortHead>
            <SortHead name="score" figures title={SCORE} {...head}>
              Score
            </SortHead>
            <SortHead name="best" figures {...head}>
              Best
            </SortHead>
            <SortHead name="parts" figures {...head}>
              Parts
            </SortHead>
            <SortHead name="cost" figures {...head}>
              $ a success
            </SortHead>
            <SortHead name="refused" figures {...head}>
              Refused
            </SortHead>
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {rows.map((row) => (
            <TaskRow
              key={`${row.model} ${row.configuration}`}
              row={row}
              tied={row.rank !== null && ties.has(row.rank)}
              several={several}
            />
          ))}
        </Table.Tbody>
      </Table>
    </Table.ScrollContainer>
  );
}

/** Who ran a row's trials besides the service, and what of them counts nowhere. */
function Proof({ row }: { row: Row }) {
  const waiting = row.unverified - row.refuted;
  const parts = [
    row.by_runner > 0 && `${row.by_runner} by a runner`,
    waiting > 0 && `${waiting} to be verified`,
    row.refuted > 0 && `${row.refuted} refuted`,
  ].filter((part) => part !== false);
  return parts.length > 0 && <small className="dimmed">{parts.join(", ")}</small>;
}

function TaskRow({ row, tied, several }: { row: Row; tied: boolean; several: boolean }) {
  const success = `${successes(row.successes)} of ${row.counted}`;
  return (
    <Table.Tr>
      <Table.Td>
        <Group gap={6} wrap="nowrap">
          <Link className="quiet" to="/jobs" search={jobsBehind(row)}>
            {row.model}
            {several && <small> ({row.configuration.slice(0, 8)})</small>}
          </Link>
          {row.flagged > 0 && (
            <Badge size="sm" color="yellow" variant="outline" tt="none" styles={{ root: { color: "inherit" } }}>
              {row.flagged} flagged
            </Badge>
          )}
          <Proof row={row} />
        </Group>
      </Table.Td>
      <Table.Td className="figures">
        {row.rank ?? "–"}
        {tied && <small className="dimmed"> tied</small>}
      </Table.Td>
      <Table.Td className="figures">{places(row.rank_low, row.rank_high)}</Table.Td>
      <Table.Td>
        <Group gap={8} wrap="nowrap">
          <Interval
            low={row.success_low}
            high={row.success_high}
            value={row.success_rate}
            from={0}
            to={1}
            label={`success ${success}`}
          />
          <Text size="sm" className="figures" style={{ whiteSpace: "nowrap" }}>
            {percent(row.success_rate)} ({success})
            <Text span size="xs" className="dimmed" display="block">
              {percent(row.success_low)} to {percent(row.success_high)}
            </Text>
          </Text>
        </Group>
      </Table.Td>
      <Table.Td className="figures">
        {row.censored > 0 && row.indicator_mean !== null ? "≥ " : ""}
        {number(row.indicator_mean)}
        <Text size="xs" className="dimmed">
          {row.indicator_low === null
            ? row.too_few_data
              ? "too few data"
              : ""
            : `${number(row.indicator_low)} to ${number(row.indicator_high)}`}
        </Text>
      </Table.Td>
      <Table.Td className="figures">
        {number(row.score, 2)}
        <Text size="xs" className="dimmed">
          {row.score_low !== null && `${number(row.score_low, 2)} to ${number(row.score_high, 2)}`}
        </Text>
      </Table.Td>
      <Table.Td className="figures">
        {row.censored > 0 && row.indicator_best !== null ? "≥ " : ""}
        {number(row.indicator_best)}
      </Table.Td>
      <Table.Td className="figures">{count(row.parts_mean)}</Table.Td>
      <Table.Td className="figures">{dollars(row.cost_per_success_usd)}</Table.Td>
      <Table.Td className="figures">{percent(row.refused_action_rate)}</Table.Td>
    </Table.Tr>
  );
}
