import { Text } from "@mantine/core";
import type { ReactNode } from "react";

interface Row {
  key: string;
  label: string;
  /** One for each task. */
  cells: readonly ReactNode[];
}

/** A table of models by tasks that scrolls sideways. */
export function ModelByTask({
  heads,
  rows,
}: {
  heads: readonly { task: string; head: ReactNode }[];
  rows: readonly Row[];
}) {
  return (
    <div style={{ overflowX: "auto" }} tabIndex={0} role="region" aria-label="Model by task, scrolls sideways">
      <table className="heat figures sticky-first">
        <thead>
          <tr>
            <th scope="col" style={{ textAlign: "left" }}>
              <Text size="sm" fw={600}>
                Model
              </Text>
            </th>
            {heads.map(({ task, head }) => (
              <th key={task} scope="col">
                {head}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {rows.map((row) => (
            <tr key={row.key}>
              <th scope="row" style={{ textAlign: "left", paddingRight: 10 }}>
                <Text size="sm" fw={500} style={{ whiteSpace: "nowrap" }}>
                  {row.label}
                </Text>
              </th>
              {row.cells.map((cell, index) => (
                <td key={heads[index]?.task}>{cell}</td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
