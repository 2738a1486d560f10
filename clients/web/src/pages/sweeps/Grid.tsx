import { Group, Text } from "@mantine/core";
import { Link } from "@tanstack/react-router";
import { count, words } from "../../format";
import { ModelByTask } from "../../parts/ModelByTask";
import { OUTCOME_COLOURS } from "../../theme";
import type { CellCounts, Moment } from "./live";

/** The order of a cell's parts, from good to open. */
const ORDER = [
  "success",
  "unsuccessful",
  "construction_failed",
  "limit",
  "errored",
  "cancelled",
  "running",
  "on_hold",
  "queued",
];

function colour(name: string): string {
  if (name === "queued") return "var(--mantine-color-default-border)";
  return `var(--mantine-color-${OUTCOME_COLOURS[name] ?? "gray"}-5)`;
}

/** A task x model grid that fills up as jobs end. */
export function Grid({ moment, sweep }: { moment: Moment; sweep: string }) {
  const { cells: models, tasks, totals } = moment;
  const names = ORDER.filter((name) => totals.has(name));
  return (
    <>
      <Group gap="md" mb="xs">
        {names.map((name) => (
          <Group key={name} gap={5}>
            <span aria-hidden style={{ width: 12, height: 12, borderRadius: 3, background: colour(name) }} />
            <Text size="xs">
              {words(name)}: {count(totals.get(name))}
            </Text>
          </Group>
        ))}
      </Group>
      <ModelByTask
        heads={tasks.map((task) => ({
          task,
          head: (
            <Text size="xs" fw={600}>
              {task}
            </Text>
          ),
        }))}
        rows={[...models].map(([model, cells]) => ({
          key: model,
          label: model,
          cells: tasks.map((task) => (
            <Cell key={task} cell={cells.get(task)} task={task} model={model} sweep={sweep} />
          )),
        }))}
      />
    </>
  );
}

function Cell({
  cell,
  task,
  model,
  sweep,
}: {
  cell: CellCounts | undefined;
  task: string;
  model: string;
  sweep: string;
}) {
  if (cell === undefined) return <span className="heat-cell heat-empty">–</span>;
  const parts = ORDER.flatMap((name) => {
    const n = cell.counts.get(name);
    return n === undefined ? [] : [{ name, n }];
  });
  const ended =
    cell.total - ["queued", "running", "on_hold"].reduce((sum, name) => sum + (cell.counts.get(name) ?? 0), 0);
  return (
    <Link
      className="heat-cell"
      to="/jobs"
      search={{ task, model, sweep }}
      style={{ color: "inherit", borderColor: "var(--mantine-color-default-border)" }}
      title={parts.map(({ name, n }) => `${n} ${words(name)}`).join(", ")}
    >
      <span>
        {cell.counts.get("success") ?? 0}
        <small> ✓ of {ended}</small>
      </span>
      <svg width={64} height={8} viewBox={`0 0 ${cell.total} 1`} preserveAspectRatio="none" aria-hidden>
        {parts.map(({ name, n }, index) => (
          <rect
            key={name}
            x={parts.slice(0, index).reduce((sum, part) => sum + part.n, 0)}
            width={n}
            height={1}
            fill={colour(name)}
          />
        ))}
      </svg>
    </Link>
  );
}
