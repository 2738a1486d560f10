import { SimpleGrid, Text } from "@mantine/core";
import * as Plot from "@observablehq/plot";
import { useCallback } from "react";
import type { Board } from "../../api/queries";
import { words } from "../../format";
import Drawing from "../../parts/Plot";
import { Section } from "../../parts/Section";
import { cellOf, modelsInOrder } from "./HeatMap";
import type { BoardSearch } from "./search";

/** What the board means: cost against performance, dimensions, reasons of failure. */
export default function BoardPlots({ board, search }: { board: Board; search: BoardSearch }) {
  const models = modelsInOrder(board, search.baselines !== "no");
  return (
    <SimpleGrid cols={{ base: 1, md: 2 }}>
      <Section title="Why attempts fail">
        <Failures board={board} models={models} />
      </Section>
      <Section title="Difficulty dimensions">
        <Dimensions board={board} models={models} />
      </Section>
      <Section title="Cost and success">
        <Costs board={board} models={models} />
      </Section>
    </SimpleGrid>
  );
}

export interface Reason {
  model: string;
  reason: string;
  jobs: number;
}

/** How many counted jobs of each model failed for each reason, over all tasks. */
export function reasonsOf(board: Board, models: readonly string[]): Reason[] {
  return models.flatMap((model) => {
    const sums = new Map<string, number>();
    for (const task of board.tasks) {
      for (const [reason, jobs] of Object.entries(cellOf(task, model)?.reasons ?? {})) {
        sums.set(reason, (sums.get(reason) ?? 0) + jobs);
      }
    }
    return [...sums].map(([reason, jobs]) => ({ model, reason: words(reason), jobs }));
  });
}

function Failures({ board, models }: { board: Board; models: string[] }) {
  const found = reasonsOf(board, models);
  const options = useCallback(
    () => ({
      height: 60 + 34 * models.length,
      marginLeft: 110,
      style: { fontSize: "12px" },
      color: { legend: true, scheme: "Observable10" as const },
      x: { label: "failed jobs", grid: true },
      y: { label: null, domain: models },
      marks: [Plot.barX(found, { x: "jobs", y: "model", fill: "reason", tip: true }), Plot.ruleX([0])],
    }),
    [found, models],
  );
  if (found.length === 0) return <Text size="sm">No counted job has failed.</Text>;
  return <Drawing options={options} label={found.map((one) => `${one.model}: ${one.jobs} ${one.reason}`).join("; ")} />;
}

function Dimensions({ board, models }: { board: Board; models: string[] }) {
  const rows = board.overall
    .filter((row) => models.includes(row.model))
    .flatMap((row) => Object.entries(row.dimensions).map(([name, score]) => ({ model: row.model, name: words(name), score })));
  const names = new Set(rows.map((row) => row.name)).size;
  const options = useCallback(
    () => ({
      height: 70 + 30 * names,
      marginLeft: 110,
      style: { fontSize: "12px" },
      symbol: { legend: true },
      x: { domain: [0, 1], label: "score, 0 to 1", grid: true },
      y: { label: null },
      marks: [
        Plot.ruleY(rows, Plot.groupY({ x1: "min", x2: "max" }, { y: "name", x: "score", strokeOpacity: 0.3 })),
        Plot.dot(rows, { x: "score", y: "name", symbol: "model", stroke: "model", r: 5, strokeWidth: 2, tip: true }),
      ],
    }),
    [rows, names],
  );
  if (rows.length === 0) return <Text size="sm">No task of the board has difficulty dimensions.</Text>;
  return <Drawing options={options} label={rows.map((row) => `${row.model}, ${row.name}: ${row.score.toFixed(2)}`).join("; ")} />;
}

function Costs({ board, models }: { board: Board; models: string[] }) {
  const rows = board.overall
    .filter((row) => models.includes(row.model) && row.success_rate_mean !== null)
    .map((row) => ({ model: row.model, tokens: row.output_tokens_mean ?? 0, cost: row.cost_usd_mean ?? 0, success: 100 * (row.success_rate_mean ?? 0), pareto: row.pareto }));
  const priced = rows.some((row) => row.cost > 0);
  const options = useCallback(
    () => ({
      height: 260,
      marginRight: 90,
      style: { fontSize: "12px" },
      x: { label: priced ? "dollars a job →" : "output tokens a job →", grid: true, zero: true },
      y: { label: "↑ success, mean of tasks, %", domain: [0, 100], grid: true },
      marks: [
        Plot.line(rows.filter((row) => row.pareto), { x: priced ? "cost" : "tokens", y: "success", sort: priced ? "cost" : "tokens", strokeDasharray: "4 3", curve: "step-after" as const }),
        Plot.dot(rows, { x: priced ? "cost" : "tokens", y: "success", r: 5, fill: "currentColor", fillOpacity: 0.7, tip: true }),
        Plot.text(rows, { x: priced ? "cost" : "tokens", y: "success", text: "model", dx: 9, textAnchor: "start" }),
      ],
    }),
    [rows, priced],
  );
  if (rows.length === 0) return <Text size="sm">Nothing was scored yet.</Text>;
  return (
    <>
      <Drawing options={options} label={rows.map((row) => `${row.model}: ${row.success.toFixed(0)} % at $${row.cost}`).join("; ")} />
      <Text size="xs" className="dimmed">
        {priced ? "The dashed line joins models that none beats at a lower price." : "No job has cost anything: output tokens stand in."}
      </Text>
    </>
  );
}
