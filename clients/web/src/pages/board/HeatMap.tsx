import { Chip, Group, Text } from "@mantine/core";
import { Link, useNavigate } from "@tanstack/react-router";
import type { Board, Row, TaskBoard } from "../../api/queries";
import { measured, number, percent, successes } from "../../format";
import { ModelByTask } from "../../parts/ModelByTask";
import { cellOf, entriesOf, type Entry } from "./entries";
import type { BoardSearch, Figure } from "../../api/board-search";
import { jobsBehind } from "../../parts/jobs-behind";
import { shade, shareOf } from "./shades";

const FIGURES: readonly { value: Figure; label: string }[] = [
  { value: "success", label: "Success" },
  { value: "indicator", label: "Indicator" },
];

function valueOf(row: Row | undefined, figure: Figure): number | null {
  if (row === undefined) return null;
  if (figure === "success") return row.success_rate;
  return row.indicator_mean;
}

/** How well each model does on each task; every cell opens the jobs behind it. */
export function HeatMap({ board, search }: { board: Board; search: BoardSearch }) {
  const navigate = useNavigate({ from: "/" });
  const figure = search.figure ?? "success";
  const entries = entriesOf(board, search.baselines !== "no");
  return (
    <>
      <Group justify="space-between" mb="xs">
        <Text size="sm" className="dimmed">
          {figure === "success"
            ? "Share of counted jobs that succeeded. "
            : "Mean performance indicator, in each task’s unit. "}
          A cell opens the jobs behind it.
        </Text>
        <Chip.Group
          value={figure}
          onChange={(value) => {
            const chosen = FIGURES.find((one) => one.value === value)?.value;
            void navigate({
              search: (before) => ({ ...before, figure: chosen === "success" ? undefined : chosen }),
              replace: true,
              resetScroll: false,
            });
          }}
        >
          <Group gap={6} role="radiogroup" aria-label="Figure">
            {FIGURES.map(({ value, label }) => (
              <Chip key={value} value={value} size="xs" radius="sm">
                {label}
              </Chip>
            ))}
          </Group>
        </Chip.Group>
      </Group>
      <ModelByTask
        heads={board.tasks.map((task) => ({
          task: task.task,
          head: (
            <>
              <Link className="quiet" to="/tasks/$name" params={{ name: task.task }}>
                <Text size="xs" fw={600}>
                  {task.task}
                </Text>
              </Link>
              {figure === "indicator" && (
                <Text size="xs" className="dimmed">
                  {measured(task.indicator, task.unit)}
                </Text>
              )}
            </>
          ),
        }))}
        rows={entries.map((entry) => ({
          key: entry.key,
          label: entry.label,
          cells: board.tasks.map((task) => (
            <Cell key={task.task} task={task} entry={entry} figure={figure} entries={entries} />
          )),
        }))}
      />
    </>
  );
}

interface CellOf {
  task: TaskBoard;
  entry: Entry;
  figure: Figure;
  entries: readonly Entry[];
}

function Cell({ task, entry, figure, entries }: CellOf) {
  const row = cellOf(task, entry);
  const value = valueOf(row, figure);
  if (row === undefined || value === null) {
    return <span className="heat-cell heat-empty">–</span>;
  }
  const values = entries.map((other) => valueOf(cellOf(task, other), figure));
  const share = figure === "success" ? value : (shareOf(value, values) ?? 0);
  const shown = figure === "success" ? percent(value) : number(value);
  const interval = `95 % interval ${percent(row.success_low)} to ${percent(row.success_high)}`;
  return (
    <Link
      className="heat-cell"
      to="/jobs"
      search={jobsBehind(row)}
      style={shade(share)}
      title={`${entry.label} on ${task.task}: ${successes(row.successes)} of ${row.counted} succeeded, ${interval}${row.flagged > 0 ? `; ${row.flagged} flagged` : ""}`}
    >
      <span>
        {row.censored > 0 && figure === "indicator" ? "≥ " : ""}
        {shown}
      </span>
      <small>
        {successes(row.successes)} of {row.counted}
        {row.flagged > 0 ? ` · ${row.flagged} ⚑` : ""}
      </small>
    </Link>
  );
}
