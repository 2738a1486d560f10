import { Text } from "@mantine/core";
import * as Plot from "@observablehq/plot";
import type { Figures } from "../../api/queries";
import { count, dollars, number, percent } from "../../format";
import { DataTable } from "../../parts/DataTable";
import Drawing, { BESIDE, POINTS } from "../../parts/Plot";
import { keyOf, type Entry } from "./entries";

/** Cost against performance: who is not beaten at a lower price. */
export function Costs({ figures, entries }: { figures: Figures; entries: readonly Entry[] }) {
  const rows = entries.flatMap((entry) => {
    const found = figures.front.find((one) => keyOf(one) === entry.key);
    return found === undefined ? [] : [{ ...found, label: entry.label }];
  });
  const priced = rows.some((row) => (row.cost_usd_mean ?? 0) > 0);
  const price = priced ? "cost_usd_mean" : "output_tokens_mean";
  const drawn = rows.filter((row) => row.mean_rank !== null && row[price] !== null);
  const options = (): Plot.PlotOptions => ({
    height: 300,
    marginRight: 40,
    marginTop: 26,
    marginBottom: 42,
    style: { fontSize: "12px" },
    x: { label: priced ? "dollars a job →" : "output tokens a job →", grid: true, zero: true },
    y: { label: "↑ mean rank over tasks, 1 is best", reverse: true, grid: true, nice: true, zero: false },
    marks: [
      Plot.line(
        drawn.filter((row) => row.pareto),
        { x: price, y: "mean_rank", sort: price, strokeDasharray: "5 3", strokeOpacity: 0.7 },
      ),
      Plot.dot(drawn, {
        x: price,
        y: "mean_rank",
        r: 5.5,
        className: POINTS,
        symbol: (row: { pareto: boolean }) => (row.pareto ? "diamond" : "circle"),
        fill: (row: { pareto: boolean }) => (row.pareto ? "#009e73" : "#999999"),
        stroke: "currentColor",
        strokeWidth: 1,
      }),
      Plot.text(drawn, { x: price, y: "mean_rank", text: "label", ...BESIDE }),
    ],
  });
  if (rows.length === 0) return <Text size="sm">Nothing was scored yet.</Text>;
  const figure = (row: (typeof rows)[number]): string[] => [
    row.label,
    number(row.mean_rank, 2),
    percent(row.success_rate_mean, 1),
    dollars(row.cost_usd_mean),
    count(row.output_tokens_mean),
    row.pareto ? "yes" : "no",
  ];
  return (
    <>
      {drawn.length > 0 && <Drawing options={options} label={rows.map((row) => figure(row).join(", ")).join("; ")} />}
      <Text size="xs" className="dimmed" mt={6} mb={4}>
        Diamonds and their line: the Pareto front, models that no other beats at a lower price.{" "}
        {!priced && "No job has cost anything: output tokens stand in on the axis."}
      </Text>
      <DataTable
        name="Cost and performance"
        columns={["Model", "Mean rank", "Success, mean of tasks", "$ a job", "Output tokens", "Pareto"]}
        rows={rows.map(figure)}
      />
    </>
  );
}
