import { Badge, Group, Table, Text } from "@mantine/core";
import { Link } from "@tanstack/react-router";
import type { Row, TaskBoard } from "../api/queries";
import { count, dollars, number, percent, places } from "../format";
import { Interval } from "./Interval";

/** All models on one task, the best first. */
export function TaskTable({ task }: { task: TaskBoard }) {
  return (
    <Table.ScrollContainer minWidth={820} type="native">
      <Table highlightOnHover className="sticky-first">
        <Table.Thead>
          <Table.Tr>
            <Table.Th>Model</Table.Th>
            <Table.Th className="figures">Rank</Table.Th>
            <Table.Th className="figures">Place</Table.Th>
            <Table.Th>Success, 95 % interval</Table.Th>
            <Table.Th className="figures">
              {task.indicator}, {task.unit}
            </Table.Th>
            <Table.Th className="figures">Best</Table.Th>
            <Table.Th className="figures">Parts</Table.Th>
            <Table.Th className="figures">$ a success</Table.Th>
            <Table.Th className="figures">Refused</Table.Th>
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {task.rows.map((row) => (
            <TaskRow key={`${row.model} ${row.configuration}`} row={row} task={task.task} />
          ))}
        </Table.Tbody>
      </Table>
    </Table.ScrollContainer>
  );
}

function TaskRow({ row, task }: { row: Row; task: string }) {
  const success = `${row.successes} of ${row.trials}`;
  return (
    <Table.Tr>
      <Table.Td>
        <Group gap={6} wrap="nowrap">
          <Link className="quiet" to="/jobs" search={{ task, model: row.model }}>
            {row.model}
          </Link>
          {row.flagged > 0 && (
            <Badge size="sm" color="yellow" variant="outline" tt="none" styles={{ root: { color: "inherit" } }}>
              {row.flagged} flagged
            </Badge>
          )}
        </Group>
      </Table.Td>
      <Table.Td className="figures">{row.rank ?? "–"}</Table.Td>
      <Table.Td className="figures">{places(row.rank_low, row.rank_high)}</Table.Td>
      <Table.Td>
        <Group gap={8} wrap="nowrap">
          <Interval low={row.success_low} high={row.success_high} value={row.success_rate} from={0} to={1} label={`success ${success}`} />
          <Text size="sm" className="figures" style={{ whiteSpace: "nowrap" }}>
            {percent(row.success_rate)} ({success})
          </Text>
        </Group>
      </Table.Td>
      <Table.Td className="figures">
        {row.censored > 0 ? "≥ " : ""}
        {number(row.indicator_mean)}
        <Text size="xs" className="dimmed">
          {row.indicator_low === null ? (row.too_few_data ? "too few data" : "") : `${number(row.indicator_low)} to ${number(row.indicator_high)}`}
        </Text>
      </Table.Td>
      <Table.Td className="figures">{number(row.indicator_best)}</Table.Td>
      <Table.Td className="figures">{count(row.parts_mean)}</Table.Td>
      <Table.Td className="figures">{dollars(row.cost_per_success_usd)}</Table.Td>
      <Table.Td className="figures">{percent(row.invalid_action_rate)}</Table.Td>
    </Table.Tr>
  );
}
