import { Group, Text } from "@mantine/core";
import * as Plot from "@observablehq/plot";
import type { Figures } from "../../api/queries";
import { number, words } from "../../format";
import { DataTable } from "../../parts/DataTable";
import Drawing from "../../parts/Plot";
import { keyOf, type Entry } from "./entries";
import { strokeOf } from "./palette";

const RINGS = [0.25, 0.5, 0.75, 1];
const EDGE = 1.42;
const HEIGHT = 300;
const NARROW = 430;

interface Spot {
  x: number;
  y: number;
}

/** Where a score stands on the axis of a dimension, the first on top, then clockwise. */
export function spotOf(index: number, count: number, score: number): Spot {
  const angle = (2 * Math.PI * index) / count;
  return { x: score * Math.sin(angle), y: score * Math.cos(angle) };
}

/** Scores along the difficulty dimensions, a closed line for each model. */
export function Radar({ figures, entries }: { figures: Figures; entries: readonly Entry[] }) {
  const rows = entries.flatMap((entry) => {
    const found = figures.dimensions.find((one) => keyOf(one) === entry.key);
    return found === undefined ? [] : [{ entry, dimensions: found.dimensions }];
  });
  const names = Object.keys(rows[0]?.dimensions ?? {});
  const options = (width: number): Plot.PlotOptions => {
    const corners = (score: (name: string) => number): Spot[] =>
      [...names, ...names.slice(0, 1)].map((name, index) => spotOf(index, names.length, score(name)));
    const labels = names.map((name, index) => {
      const spot = spotOf(index, names.length, 1.1);
      return { name: words(name), ...spot, textAnchor: spot.x > 0.1 ? "start" : spot.x < -0.1 ? "end" : "middle" };
    });
    // Labels beside the circle need room that a phone has only if the circle is smaller.
    const edge = width < NARROW ? 1.5 * EDGE : EDGE;
    const wide = (edge * width) / HEIGHT;
    return {
      height: HEIGHT,
      margin: 4,
      x: { axis: null, domain: [-wide, wide] },
      y: { axis: null, domain: [-edge, edge] },
      marks: [
        ...RINGS.map((ring) =>
          Plot.line(
            corners(() => ring),
            { x: "x", y: "y", strokeOpacity: 0.25, strokeWidth: 1 },
          ),
        ),
        Plot.link(
          names.map((_, index) => spotOf(index, names.length, 1)),
          { x1: 0, y1: 0, x2: "x", y2: "y", strokeOpacity: 0.2 },
        ),
        ...(["start", "middle", "end"] as const).map((textAnchor) =>
          Plot.text(
            labels.filter((label) => label.textAnchor === textAnchor),
            { x: "x", y: "y", text: "name", fontSize: 12, textAnchor },
          ),
        ),
        ...rows.map(({ dimensions }, index) =>
          Plot.line(
            corners((name) => dimensions[name] ?? 0),
            { x: "x", y: "y", strokeWidth: 2.2, ...strokeOf(index) },
          ),
        ),
        // Above the lines, which would strike them out.
        Plot.text(
          RINGS.map((ring) => ({ ring: String(ring), ...spotOf(0.5, names.length, 0.86 * ring) })),
          { x: "x", y: "y", text: "ring", fontSize: 9, stroke: "var(--mantine-color-body)", fill: "currentColor" },
        ),
      ],
    };
  };
  if (rows.length === 0) return <Text size="sm">No ranked model has scores along difficulty dimensions.</Text>;
  return (
    <>
      <Drawing
        options={options}
        label={rows
          .map(
            ({ entry, dimensions }) =>
              `${entry.label}: ${names.map((name) => `${words(name)} ${number(dimensions[name], 2)}`).join(", ")}`,
          )
          .join("; ")}
      />
      <Group gap="md" my={6}>
        {rows.map(({ entry }, index) => (
          <Group key={entry.key} gap={6} wrap="nowrap">
            <svg width={30} height={10} aria-hidden>
              <line x1={0} x2={30} y1={5} y2={5} strokeWidth={2.5} {...strokeOf(index)} />
            </svg>
            <Text size="xs">{entry.label}</Text>
          </Group>
        ))}
      </Group>
      <Text size="xs" className="dimmed" mb={4}>
        From 0 (last on every task) to 1 (first), weighted by what the tasks ask for.
      </Text>
      <DataTable
        name="Difficulty dimensions"
        columns={["Model", ...names.map(words)]}
        rows={rows.map(({ entry, dimensions }) => [entry.label, ...names.map((name) => number(dimensions[name], 2))])}
      />
    </>
  );
}
