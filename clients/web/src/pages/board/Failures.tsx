import { Text } from "@mantine/core";
import * as Plot from "@observablehq/plot";
import type { Figures } from "../../api/queries";
import { count, percent, words } from "../../format";
import { DataTable } from "../../parts/DataTable";
import Drawing from "../../parts/Plot";
import { Section } from "../../parts/Section";
import { keyOf, type Entry } from "./entries";
import { COLOURS } from "./palette";

interface Part {
  label: string;
  name: string;
  count: number;
  share: number;
}

/** Counts by model and name as shares of the model's sum; the most frequent names first. */
export function partsOf(counted: readonly { label: string; counts: Readonly<Record<string, number>> }[]): Part[] {
  const sums = new Map<string, number>();
  for (const { counts } of counted) {
    for (const [name, n] of Object.entries(counts)) sums.set(name, (sums.get(name) ?? 0) + n);
  }
  const names = [...sums].sort((a, b) => b[1] - a[1]).map(([name]) => name);
  return counted.flatMap(({ label, counts }) => {
    const total = Object.values(counts).reduce((sum, n) => sum + n, 0);
    return names.flatMap((name) => {
      const n = counts[name] ?? 0;
      return n === 0 ? [] : [{ label, name: words(name), count: n, share: n / total }];
    });
  });
}

/** How jobs end, and why actions are refused. */
export function Failures({ figures, entries }: { figures: Figures; entries: readonly Entry[] }) {
  const rows = entries.flatMap((entry) => {
    const found = figures.failures.find((one) => keyOf(one) === entry.key);
    return found === undefined ? [] : [{ ...found, label: entry.label }];
  });
  const refused = rows.filter((row) => row.refused_actions > 0);
  return (
    <>
      <Section title="How jobs end, and why they fail">
        <Shares
          name="How jobs end"
          what="jobs"
          parts={partsOf(rows.map((row) => ({ label: row.label, counts: row.outcomes })))}
          labels={rows.map((row) => row.label)}
        />
      </Section>
      <Section title="Why actions are refused">
        {refused.length === 0 ? (
          <Text size="sm">No action was refused.</Text>
        ) : (
          <>
            <Shares
              name="Why actions are refused"
              what="actions"
              parts={partsOf(refused.map((row) => ({ label: row.label, counts: row.refusals })))}
              labels={refused.map((row) => row.label)}
            />
            <DataTable
              name="Refused of all actions"
              columns={["Model", "Actions", "Refused", "Share"]}
              rows={rows.map((row) => [
                row.label,
                count(row.actions),
                count(row.refused_actions),
                percent(row.actions === 0 ? null : row.refused_actions / row.actions, 1),
              ])}
            />
          </>
        )}
      </Section>
    </>
  );
}

function Shares({ name, what, parts, labels }: { name: string; what: string; parts: Part[]; labels: string[] }) {
  const options = (width: number): Plot.PlotOptions => ({
    height: 76 + 38 * labels.length,
    marginBottom: 42,
    marginLeft: Math.min(150, 0.3 * width),
    style: { fontSize: "12px" },
    color: { legend: true, range: [...COLOURS], domain: [...new Set(parts.map((part) => part.name))] },
    x: { label: `share of ${what}, %`, percent: true, domain: [0, 100], grid: true },
    y: { label: null, domain: labels },
    marks: [
      Plot.barX(parts, { x: "share", y: "label", fill: "name", inset: 0.5, order: null }),
      // A bar's number stands in it, so that nobody depends on its colour.
      Plot.text(
        parts,
        Plot.stackX({
          x: "share",
          y: "label",
          order: null,
          text: (part: Part) => (part.share > 0.08 ? String(part.count) : ""),
          fill: "#111111",
          stroke: "#ffffff",
          strokeWidth: 3,
          fontWeight: "600",
        }),
      ),
    ],
  });
  if (parts.length === 0) return <Text size="sm">None yet.</Text>;
  return (
    <>
      <Drawing options={options} label={parts.map((part) => `${part.label}: ${part.count} ${part.name}`).join("; ")} />
      <DataTable
        name={name}
        columns={["Model", "Kind", what, "Share"]}
        rows={parts.map((part) => [part.label, part.name, count(part.count), percent(part.share, 1)])}
      />
    </>
  );
}
