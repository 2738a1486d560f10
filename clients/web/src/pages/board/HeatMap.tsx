import { Text } from "@mantine/core";
import { Link } from "@tanstack/react-router";
import type { Board, TaskBoard } from "../../api/queries";
import { percent, successes } from "../../format";
import { jobsBehind } from "../../parts/jobs-behind";
import { cellOf, type Entry } from "./entries";

/** How often each model succeeds on each task; every cell opens the jobs behind it. */
export function HeatMap({ board, entries }: { board: Board; entries: readonly Entry[] }) {
  return (
    <div style={{ overflowX: "auto" }} tabIndex={0} role="region" aria-label="Model by task, scrolls sideways">
      <table className="heat figures sticky-first">
        <thead>
          <tr>
            <th scope="col">Model</th>
            {board.tasks.map(({ task }) => (
              <th key={task} scope="col">
                <Link className="quiet" to="/tasks/$name" params={{ name: task }}>
                  <Text size="xs" fw={600}>
                    {task}
                  </Text>
                </Link>
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {entries.map((entry) => (
            <tr key={entry.key}>
              <th scope="row">{entry.label}</th>
              {board.tasks.map((task) => (
                <td key={task.task}>
                  <Cell task={task} entry={entry} />
                </td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

function Cell({ task, entry }: { task: TaskBoard; entry: Entry }) {
  const row = cellOf(task, entry);
  if (row === undefined || row.success_rate === null) return <span className="heat-cell heat-empty">–</span>;
  const share = `${successes(row.successes)} of ${row.counted}`;
  const interval = `95 % interval ${percent(row.success_low)} to ${percent(row.success_high)}`;
  return (
    <Link
      className="heat-cell"
      to="/jobs"
      search={jobsBehind(row)}
      style={shade(row.success_rate)}
      title={`${entry.label} on ${task.task}: ${share} succeeded, ${interval}${row.flagged > 0 ? `; ${row.flagged} flagged` : ""}`}
    >
      <span>{percent(row.success_rate)}</span>
      <small>{share}</small>
    </Link>
  );
}

// From sand to teal, light enough for dark text.
const LIGHT_FROM = [246, 236, 222] as const;
const LIGHT_TO = [96, 190, 170] as const;

/** The shade of a share between 0 and 1. Its text is dark at every share: contrast stays above 7. */
function shade(share: number): React.CSSProperties {
  const clamped = Math.min(1, Math.max(0, share));
  const mixed = LIGHT_FROM.map((from, i) => Math.round(from + ((LIGHT_TO[i] ?? from) - from) * clamped));
  return { background: `rgb(${mixed.join(" ")})`, color: "#15202b" };
}
