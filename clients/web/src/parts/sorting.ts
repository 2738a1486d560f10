/** By which column of a table its rows stand, and in which direction. */
export interface Sorting {
  by: string;
  descending: boolean;
}

export type Value = string | number | null | undefined;

/** What a column's rows are sorted by, by the column's name. */
export type Values<Row> = Readonly<Record<string, (row: Row) => Value>>;

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
export function sortedRows<Row>(rows: readonly Row[], sorting: Sorting | null, values: Values<Row>): readonly Row[] {
  const value = sorting === null ? undefined : values[sorting.by];
  if (sorting === null || value === undefined) return rows;
  const sign = sorting.descending ? -1 : 1;
  return [...rows].sort((one, other) => {
    const [a, b] = [value(one), value(other)];
    if (a == null || b == null) return Number(a == null) - Number(b == null);
    return sign * compared(a, b);
  });
}

/** What a cell that people read is sorted by: its first figure if it begins with one, its text otherwise, nothing for a dash. */
export function valueOfText(text: string): Value {
  if (text === "" || text === "–") return null;
  const figure = /^[≥$−-]*\s*\$?([\d,]*\.?\d+)/.exec(text.trim());
  if (figure?.[1] === undefined) return text;
  const size = Number(figure[1].replaceAll(",", ""));
  return /^[^\d]*[−-]/.test(text.trim()) ? -size : size;
}
