import { Table } from "@mantine/core";
import { useState } from "react";
import { clicked, sortedRows, type Columns, type Sorting } from "./sorting";

/** The heads of a table's columns; one that has a value sorts the rows by it. */
export function Heads<Row>({
  columns,
  sorting,
  onSort,
}: {
  columns: Columns<Row>;
  sorting: Sorting | null;
  onSort: (to: Sorting) => void;
}) {
  return (
    <Table.Tr>
      {columns.map(({ name, label, value, figures = false, title }) => {
        const chosen = sorting?.by === name ? sorting : null;
        return (
          <Table.Th
            key={name}
            className={figures ? "figures" : undefined}
            aria-sort={chosen === null ? undefined : chosen.descending ? "descending" : "ascending"}
            title={title}
          >
            {value === undefined ? (
              label
            ) : (
              <button type="button" className="sort-head" onClick={() => onSort(clicked(sorting, name, figures))}>
                {label}
                <span aria-hidden className="sort-mark">
                  {chosen === null ? "" : chosen.descending ? "▼" : "▲"}
                </span>
              </button>
            )}
          </Table.Th>
        );
      })}
    </Table.Tr>
  );
}

/** The rows of a table as the reader sorts them, and the heads that do it. */
export function useSorting<Row>(rows: readonly Row[], columns: Columns<Row>) {
  const [sorting, onSort] = useState<Sorting | null>(null);
  return { rows: sortedRows(rows, sorting, columns), head: { columns, sorting, onSort } };
}
