import { Table } from "@mantine/core";

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
  return (
    <details>
      <summary style={{ cursor: "pointer", fontSize: 13 }}>{title}</summary>
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
                <Table.Th key={column} className={index === 0 ? undefined : "figures"}>
                  {column}
                </Table.Th>
              ))}
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {rows.map((row) => (
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
    </details>
  );
}
