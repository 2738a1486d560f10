import { Table } from "@mantine/core";
import { Fold } from "./Fold";
import { SortHead, useSorting } from "./SortHead";
import { valueOfText, type Values } from "./sorting";

/** The figures of a drawing, for those who want to read them. */
export function DataTable({
  name,
  title = "As a table",
  columns,
  rows,
}: {
  name: string;
  title?: string;
  columns: readonly string[];
  rows: readonly (readonly string[])[];
}) {
  const values: Values<readonly string[]> = Object.fromEntries(
    columns.map((column, index) => [column, (row: readonly string[]) => valueOfText(row[index] ?? "")]),
  );
  const { rows: sorted, head } = useSorting(rows, values);
  return (
    <Fold title={title}>
      <Table.ScrollContainer
        minWidth={260}
        type="native"
        tabIndex={0}
        role="region"
        aria-label={`${name}, scrolls sideways`}
      >
        <Table fz="sm" aria-label={name} verticalSpacing={4}>
          <Table.Thead>
            <Table.Tr>
              {columns.map((column, index) => (
                <SortHead key={column} name={column} figures={index > 0} {...head}>
                  {column}
                </SortHead>
              ))}
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {sorted.map((row) => (
              <Table.Tr key={row.join(" ")}>
                {row.map((value, index) => (
                  <Table.Td key={columns[index]} className={index === 0 ? undefined : "figures"}>
                    {value}
                  </Table.Td>
                ))}
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </Table.ScrollContainer>
    </Fold>
  );
}
