import type { Board, Row, TaskBoard } from "../../api/queries";

/** A model with its configuration: one row of the board. */
export interface Entry {
  key: string;
  model: string;
  configuration: string;
  /** The model's name, with what differs between its configurations where it has several. */
  label: string;
  baseline: boolean;
}

interface Named {
  model: string;
  configuration: string;
}

export function keyOf({ model, configuration }: Named): string {
  return `${model} ${configuration}`;
}

/** All rows of the board in the order of the overall ranking, then those that it does not have. */
export function entriesOf(board: Board, baselines: boolean): Entry[] {
  const found = new Map<string, Entry>();
  for (const row of [...board.overall, ...board.tasks.flatMap((task) => task.rows)]) {
    const { model, configuration, label, baseline } = row;
    if (baselines || !baseline) found.set(keyOf(row), { key: keyOf(row), model, configuration, label, baseline });
  }
  return [...found.values()];
}

/** What an entry has done on a task. */
export function cellOf(task: TaskBoard, entry: Named): Row | undefined {
  return task.rows.find((row) => row.model === entry.model && row.configuration === entry.configuration);
}

/** How the service is asked for each row of a board: by its model, and its configuration where a model has several. */
export function namesOf(board: Board): Map<string, string> {
  const rows = [...board.overall, ...board.tasks.flatMap((task) => task.rows)];
  const configurations = new Map<string, Set<string>>();
  for (const { model, configuration } of rows)
    configurations.set(model, (configurations.get(model) ?? new Set()).add(configuration));
  return new Map(
    rows.map((row) => {
      const several = (configurations.get(row.model)?.size ?? 0) > 1;
      return [keyOf(row), several ? `${row.model}@${row.configuration.slice(0, 8)}` : row.model];
    }),
  );
}
