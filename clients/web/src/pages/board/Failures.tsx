import { Text } from "@mantine/core";
import * as Plot from "@observablehq/plot";
import { useRouter } from "@tanstack/react-router";
import type { Figures } from "../../api/queries";
import { count, percent, words } from "../../format";
import type { BoardSearch } from "../../api/board-search";
import { DataTable } from "../../parts/DataTable";
import { jobsEndedSo } from "../../parts/jobs-behind";
import Drawing from "../../parts/Plot";
import { Section } from "../../parts/Section";
import { keyOf, type Entry } from "./entries";
import { coloursOf, MOST, OTHER } from "./palette";

const SUCCESS = "success";

interface Part {
  label: string;
  name: string;
  count: number;
  share: number;
  /** Where the jobs behind it are listed, if they are. */
  href?: string | undefined;
}

interface Counted {
  label: string;
  counts: Readonly<Record<string, number>>;
  /** Where the jobs of one of its names are listed. */
  hrefOf?: (name: string) => string | undefined;
}

/** Counts by model and name as shares of the model's sum; success first, then the most frequent names. */
export function partsOf(counted: readonly Counted[]): Part[] {
  const sums = new Map<string, number>();
  for (const { counts } of counted) {
    for (const [name, n] of Object.entries(counts)) sums.set(name, (sums.get(name) ?? 0) + n);
  }
  const names = [...sums].sort(foremost).map(([name]) => name);
  return counted.flatMap(({ label, counts, hrefOf }) => {
    const total = Object.values(counts).reduce((sum, n) => sum + n, 0);
    return names.flatMap((name) => {
      const n = counts[name] ?? 0;
      return n === 0 ? [] : [{ label, name: words(name), count: n, share: n / total, href: hrefOf?.(name) }];
    });
  });
}

/** The names of parts, in their order in a drawing: success first, then the most frequent. */
function kindsOf(parts: readonly Part[]): string[] {
  const sums = new Map<string, number>();
  for (const { name, count } of parts) sums.set(name, (sums.get(name) ?? 0) + count);
  return [...sums].sort(foremost).map(([name]) => name);
}

function foremost(a: readonly [string, number], b: readonly [string, number]): number {
  return Number(b[0] === SUCCESS) - Number(a[0] === SUCCESS) || b[1] - a[1];
}

/** The parts as they are drawn: what is beyond the most frequent names is one. */
export function drawnParts(parts: readonly Part[]): Part[] {
  const names = kindsOf(parts);
  if (names.length <= MOST) return [...parts];
  const kept = new Set(names.slice(0, MOST));
  return [...new Set(parts.map((part) => part.label))].flatMap((label) => {
    const own = parts.filter((part) => part.label === label);
    const rest = own.filter((part) => !kept.has(part.name));
    const sum = (of: (part: Part) => number): number => rest.reduce((total, part) => total + of(part), 0);
    const other = { label, name: OTHER.name, count: sum((part) => part.count), share: sum((part) => part.share) };
    return [...own.filter((part) => kept.has(part.name)), ...(rest.length > 0 ? [other] : [])];
  });
}

type Counts = Figures["failures"][number] & { label: string };

function rowsOf(figures: Figures, entries: readonly Entry[]): Counts[] {
  return entries.flatMap((entry) => {
    const found = figures.failures.find((one) => keyOf(one) === entry.key);
    return found === undefined ? [] : [{ ...found, label: entry.label }];
  });
}

interface Drawn {
  figures: Figures;
  entries: readonly Entry[];
}

/** How jobs end. */
export function Endings({ figures, entries, search }: Drawn & { search: BoardSearch }) {
  const router = useRouter();
  const hrefOf = (row: Counts, ended: string): string | undefined => {
    const jobs = jobsEndedSo(row, ended, figures.track, search);
    if (jobs === null) return undefined;
    return router.history.createHref(router.buildLocation({ to: "/jobs", search: jobs }).href);
  };
  const rows = rowsOf(figures, entries);
  return (
    <Section title="How jobs end, and why they fail">
      <Text size="sm" className="dimmed">
        A bar opens the jobs behind it.
      </Text>
      <Shares
        name="How jobs end"
        what="jobs"
        parts={partsOf(
          rows.map((row) => ({ label: row.label, counts: row.outcomes, hrefOf: (name) => hrefOf(row, name) })),
        )}
        labels={rows.map((row) => row.label)}
      />
    </Section>
  );
}

/** Why actions are refused. */
export function Refusals({ figures, entries }: Drawn) {
  const rows = rowsOf(figures, entries).filter((row) => row.refused_actions > 0);
  return (
    <Section title="Why actions are refused">
      {rows.length === 0 ? (
        <Text size="sm">No action was refused.</Text>
      ) : (
        <Shares
          name="Why actions are refused"
          what="actions"
          parts={partsOf(rows.map((row) => ({ label: row.label, counts: row.refusals })))}
          labels={rows.map((row) => row.label)}
        />
      )}
    </Section>
  );
}

function Shares({ name, what, parts, labels }: { name: string; what: string; parts: Part[]; labels: string[] }) {
  const drawn = drawnParts(parts);
  const kinds = kindsOf(parts);
  const domain = kinds.length > MOST ? [...kinds.slice(0, MOST), OTHER.name] : kinds;
  const options = (width: number): Plot.PlotOptions => ({
    height: 76 + 38 * labels.length,
    marginBottom: 42,
    marginLeft: Math.min(150, 0.3 * width),
    style: { fontSize: "12px" },
    color: { legend: true, range: coloursOf(domain), domain },
    x: { label: `share of ${what}, %`, percent: true, domain: [0, 100], grid: true },
    y: { label: null, domain: labels },
    marks: [
      Plot.barX(drawn, {
        x: "share",
        y: "label",
        fill: "name",
        inset: 0.5,
        order: null,
        href: "href",
        title: (part: Part) => `${part.label}: ${part.count} ${part.name}`,
      }),
      // A bar's number stands in it, so that nobody depends on its colour.
      Plot.text(
        drawn,
        Plot.stackX({
          x: "share",
          y: "label",
          order: null,
          text: (part: Part) => (part.share > 0.08 ? String(part.count) : ""),
          fill: "#111111",
          stroke: "#ffffff",
          strokeWidth: 3,
          fontWeight: "600",
          pointerEvents: "none",
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
