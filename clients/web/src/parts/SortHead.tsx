import { Table } from "@mantine/core";
import { useState, type ReactNode } from "react";
import { clicked, sortedRows, type Sorting, type Values } from "./sorting";

/** The head of a column; its table can be sorted by it where that has an effect. */
export function SortHead({
  name,
  sorting,
  onSort,
  figures = false,
  title,
  children,
}: {
  name: string;
  sorting: Sorting | null;
  onSort?: (to: Sorting) => void;
  figures?: boolean;
  title?: string;
  children: ReactNode;
}) {
  const chosen = sorting?.by === name ? sorting : null;
  return (
    <Table.Th
      className={figures ? "figures" : undefined}
      aria-sort={chosen === null ? undefined : chosen.descending ? "descending" : "ascending"}
      title={title}
    >
      {onSort === undefined ? (
        children
      ) : (
        <button
          type="button"
          className="sort-head"
          onClick={() => {
            onSort(clicked(sorting, name, figures));
          }}
        >
          {children}
          <span aria-hidden className="sort-mark">
            {chosen === null ? "" : chosen.descending ? "▼" : "▲"}
          </span>
        </button>
      )}
    </Table.Th>
  );
}

/** The rows of a table as the reader sorts them, and the heads that do it. */
export function useSorting<Row>(rows: readonly Row[], values: Values<Row>) {
  const [sorting, onSort] = useState<Sorting | null>(null);
  return { rows: sortedRows(rows, sorting, values), head: { sorting, onSort } };
}
