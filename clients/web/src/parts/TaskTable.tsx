import { Badge, Group, Table, Text } from "@mantine/core";
import { Link } from "@tanstack/react-router";
import type { Row } from "../api/queries";
import { counted, dollars, number, percent, places, successes, words } from "../format";
import { Interval } from "./Interval";
import { jobsBehind } from "./jobs-behind";
import { Heads, useSorting } from "./SortHead";
import type { Columns } from "./sorting";

/** What a score is, for whoever points at its heading. */
export const SCORE =
  "The result against the built-in expert's on a log scale: 0 nothing, 1 as much as the expert, 2 three times as much";

/** What a model did on a task, under the name of either. */
export interface Shown {
  label: string;
  row: Row;
  /** What the task measures, with its unit. */
  measure: string;
}

const columnsOf = (label: string): Columns<Shown> => [
  { name: "rank", label: "Rank", value: ({ row }) => row.rank },
  { name: "label", label, value: (one) => one.label },
  { name: "success", label: "Success, 95 % interval", value: ({ row }) => row.success_rate },
  { name: "result", label: "Result", value: ({ row }) => row.indicator_mean, figures: true },
  { name: "score", label: "vs. expert", value: ({ row }) => row.score, figures: true, title: SCORE },
  { name: "best", label: "Best", value: ({ row }) => row.indicator_best, figures: true },
  { name: "cost", label: "$ per run", value: ({ row }) => row.cost_usd_mean, figures: true },
  { name: "tests", label: "Tests", value: ({ row }) => row.test_trials_mean, figures: true },
  { name: "refused", label: "Refused", value: ({ row }) => row.refused_action_rate, figures: true },
];

/** Models on one task, or one model on its tasks. */
export function TaskTable({ name, of, shown }: { name: string; of: "Model" | "Task"; shown: readonly Shown[] }) {
  const { rows, head } = useSorting(shown, columnsOf(of));
  return (
    <div className="tall" tabIndex={0} role="region" aria-label={`${name}, scrolls`}>
      <Table stickyHeader highlightOnHover miw={820} aria-label={name}>
        <Table.Thead>
          <Heads {...head} />
        </Table.Thead>
        <Table.Tbody>
          {rows.map((one) => (
            <TaskRow key={`${one.label} ${one.row.configuration}`} {...one} />
          ))}
        </Table.Tbody>
      </Table>
    </div>
  );
}

/** Who ran a row's trials besides the service, and what of them counts nowhere. */
function Proof({ row }: { row: Row }) {
  const waiting = row.unverified - row.refuted;
  const parts = [
    row.ran_on_runner > 0 && `${row.ran_on_runner} by a runner`,
    waiting > 0 && `${waiting} to be verified`,
    row.refuted > 0 && `${row.refuted} refuted`,
  ].filter((part) => part !== false);
  return parts.length > 0 && <small className="dimmed">{parts.join(", ")}</small>;
}

function TaskRow({ label, row, measure }: Shown) {
  const success = `${successes(row.successes)} of ${row.counted}`;
  return (
    <Table.Tr className={row.baseline ? "reference" : undefined}>
      <Table.Td className="rank">{row.baseline ? "ref." : places(row.rank_low, row.rank_high)}</Table.Td>
      <Table.Td>
        <Group gap={6} wrap="nowrap">
          <Link className="quiet" to="/jobs" search={jobsBehind(row)}>
            {label}
          </Link>
          {row.flagged > 0 && (
            <Badge size="sm" color="yellow" variant="outline" tt="none" styles={{ root: { color: "inherit" } }}>
              {row.flagged} flagged
            </Badge>
          )}
          <Proof row={row} />
        </Group>
      </Table.Td>
      <Table.Td>
        <Group gap={8} wrap="nowrap" title={`${percent(row.success_low)} to ${percent(row.success_high)}`}>
          <Interval
            low={row.success_low}
            high={row.success_high}
            value={row.success_rate}
            from={0}
            to={1}
            label={`success ${success}, ${percent(row.success_low)} to ${percent(row.success_high)}`}
          />
          <span className="figures">
            {percent(row.success_rate)} <small className="dimmed">{success}</small>
          </span>
        </Group>
      </Table.Td>
      <Table.Td className="figures">
        {row.censored > 0 && row.indicator_mean !== null ? "≥ " : ""}
        {number(row.indicator_mean)}{" "}
        <Text size="xs" className="dimmed">
          {row.too_few_data ? `${measure}; too few data` : measure}
          {row.indicator_low !== null && `, ${number(row.indicator_low)} to ${number(row.indicator_high)}`}
        </Text>
      </Table.Td>
      <Table.Td className="figures">{number(row.score, 2)}</Table.Td>
      <Table.Td className="figures">
        {row.censored > 0 && row.indicator_best !== null ? "≥ " : ""}
        {number(row.indicator_best)}
      </Table.Td>
      <Table.Td className="figures">{dollars(row.cost_usd_mean)}</Table.Td>
      <Table.Td className="figures">{number(row.test_trials_mean)}</Table.Td>
      <Table.Td className="figures">{percent(row.refused_action_rate)}</Table.Td>
    </Table.Tr>
  );
}

/** Why a model's actions are refused, in a line. */
export function refusalsOf(rows: readonly Row[]): string {
  const sums = new Map<string, number>();
  for (const { refusals } of rows)
    for (const [name, n] of Object.entries(refusals)) sums.set(name, (sums.get(name) ?? 0) + n);
  const parts = [...sums].sort((a, b) => b[1] - a[1]).map(([name, n]) => `${words(name)} ${n}`);
  return parts.length === 0 ? "" : `${counted(sums.size, "kind")} of refused actions: ${parts.join(", ")}`;
}
