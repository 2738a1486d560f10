/** The column and direction by which a table's rows are sorted. */
export interface Sorting {
  by: string;
  descending: boolean;
}

export type Value = string | number | null | undefined;

/** A table's columns: the heading of each, and what its rows are sorted by, if they can be. */
export type Columns<Row> = readonly {
  name: string;
  label: string;
  value?: (row: Row) => Value;
  figures?: boolean;
  title?: string;
}[];

/** The sorting after a click: figures begin with the greatest, names with the first. */
export function clicked(before: Sorting | null, by: string, figures: boolean): Sorting {
  return before?.by === by ? { by, descending: !before.descending } : { by, descending: figures };
}

function compared(a: Value, b: Value): number {
  return typeof a === "number" && typeof b === "number"
    ? a - b
    : String(a).localeCompare(String(b), "en", { numeric: true });
}

/** Rows as they are sorted; those without a value come last, in both directions, and equal ones stay as they were. */
export function sortedRows<Row>(rows: readonly Row[], sorting: Sorting | null, columns: Columns<Row>): readonly Row[] {
  const value = columns.find(({ name }) => name === sorting?.by)?.value;
  if (sorting === null || value === undefined) return rows;
  const sign = sorting.descending ? -1 : 1;
  return [...rows].sort((one, other) => {
    const [a, b] = [value(one), value(other)];
    if (a == null || b == null) return Number(a == null) - Number(b == null);
    return sign * compared(a, b);
  });
}
