import { Group, Table, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useDeferredValue } from "react";
import { someJobs, type Board, type JobFilters, type OverallRow } from "../../api/queries";
import { count, dollars, number, percent, places } from "../../format";
import { Thumbnail } from "../../parts/Gallery";
import { Interval } from "../../parts/Interval";
import { SCORE } from "../../parts/TaskTable";
import { Heads, useSorting } from "../../parts/SortHead";
import type { Columns } from "../../parts/sorting";
import { oneOfEach } from "../tasks/Machines";
import { keyOf, type Entry } from "./entries";

const COLUMNS: Columns<OverallRow> = [
  { name: "rank", label: "Rank", value: (row) => row.rank },
  { name: "model", label: "Model", value: (row) => row.model },
  { name: "success", label: "Success, 95 % interval", value: (row) => row.success_rate_mean },
  { name: "score", label: "vs. expert", value: (row) => row.score_mean, figures: true, title: SCORE },
  { name: "cost", label: "$ per run", value: (row) => row.cost_usd_mean, figures: true },
  { name: "machines", label: "Best machines" },
  { name: "runs", label: "Runs", value: (row) => row.counted, figures: true },
];

/** Models ranked over all tasks of the board; baselines are below them, for comparison. */
export function Overall({ board, entries, scope }: { board: Board; entries: readonly Entry[]; scope: JobFilters }) {
  const labels = new Map(entries.map((entry) => [entry.key, entry.label]));
  const shown = board.overall.filter((row) => labels.has(keyOf(row)));
  const ordered = [...shown].sort((a, b) => Number(a.baseline) - Number(b.baseline));
  const most = Math.max(...shown.map((row) => row.counted));
  const { rows, head } = useSorting(ordered, COLUMNS);
  // Figures are shown before pictures are asked for.
  const pictured = useDeferredValue(PICTURED, 0);
  return (
    <div className="tall" tabIndex={0} role="region" aria-label="Models, scrolls">
      <Table stickyHeader highlightOnHover miw={860} aria-label="Overall">
        <Table.Thead>
          <Heads {...head} />
        </Table.Thead>
        <Table.Tbody>
          {rows.map((row, place) => (
            <Table.Tr key={keyOf(row)} className={row.baseline ? "reference" : undefined}>
              <Table.Td className="rank">{row.baseline ? "ref." : places(row.rank_low, row.rank_high)}</Table.Td>
              <Table.Td>
                <Link className="quiet" to="/models/$" params={{ _splat: row.model }}>
                  <b>{labels.get(keyOf(row))}</b>
                </Link>
                {!row.baseline && row.missing.length > 0 && (
                  <Text size="xs" className="dimmed" title={row.missing.join(", ")}>
                    {board.tasks.length - row.missing.length} of {board.tasks.length} tasks run
                  </Text>
                )}
              </Table.Td>
              <Table.Td>
                <Success row={row} />
              </Table.Td>
              <Table.Td className="figures">{number(row.score_mean, 2)}</Table.Td>
              <Table.Td className="figures">{dollars(row.cost_usd_mean)}</Table.Td>
              <Table.Td>{place < pictured && <BestMachines row={row} scope={scope} />}</Table.Td>
              <Table.Td className="figures">
                <Link
                  className="quiet"
                  to="/jobs"
                  search={{ ...scope, model: row.model, configuration: row.configuration, state: "done" }}
                  aria-label={`Runs of ${labels.get(keyOf(row)) ?? row.model}`}
                >
                  {row.counted === most ? count(most) : `${count(row.counted)} of ${count(most)}`}
                </Link>
              </Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
    </div>
  );
}

/** Rows that have pictures: each asks for a list of jobs. */
const PICTURED = 12;
const PICTURES = 3;
const LOOKED_AT = 30;

/** A row's best machines by their pictures, each of another task where there are several. */
function BestMachines({ row, scope }: { row: OverallRow; scope: JobFilters }) {
  const { model, configuration } = row;
  const of: JobFilters = { ...scope, model, configuration, outcome: "success", sort: "indicator", limit: LOOKED_AT };
  const jobs = useQuery(someJobs(of)).data ?? [];
  return (
    <Group gap={6} wrap="nowrap">
      {oneOfEach(jobs, (job) => job.task, PICTURES).map((job) => (
        <Link key={job.id} to="/jobs/$id" params={{ id: job.id }} style={{ width: 70 }}>
          <Thumbnail id={job.id} label={`${model} on ${job.task}, seed ${job.seed}`} height={40} />
        </Link>
      ))}
    </Group>
  );
}

/** The mean success rate with its interval. */
function Success({ row }: { row: OverallRow }) {
  const { success_low: low, success_high: high } = row;
  const label = `success ${percent(row.success_rate_mean)}${low === null ? "" : `, ${percent(low)} to ${percent(high)}`}`;
  return (
    <Group gap={10} wrap="nowrap">
      <Interval low={low} high={high} value={row.success_rate_mean} from={0} to={1} width={160} label={label} />
      <span className="figures">{percent(row.success_rate_mean)}</span>
    </Group>
  );
}
