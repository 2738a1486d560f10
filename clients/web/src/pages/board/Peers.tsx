import { Table, Text } from "@mantine/core";
import type { TaskBoard } from "../../api/queries";
import { number } from "../../format";

/** What other benchmarks published of the task most like this one: their task in their world. */
export function Peers({ task }: { task: TaskBoard }) {
  const { peers } = task;
  if (peers.length === 0) return null;
  return (
    <details style={{ marginTop: 8 }}>
      <summary style={{ cursor: "pointer", fontSize: 14 }}>Published elsewhere, never ranked with ours</summary>
      <Table.ScrollContainer minWidth={480} type="native">
        <Table verticalSpacing={5} mt="xs">
          <Table.Thead>
            <Table.Tr>
              <Table.Th>Model</Table.Th>
              <Table.Th>Workflow</Table.Th>
              <Table.Th>Its task</Table.Th>
              <Table.Th className="figures">Mean</Table.Th>
              <Table.Th className="figures">Spread</Table.Th>
              <Table.Th className="figures">Best</Table.Th>
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {peers.map((row) => (
              <Table.Tr key={`${row.model} ${row.workflow}`} className="ghost">
                <Table.Td>{row.model}</Table.Td>
                <Table.Td>{row.workflow.replaceAll("_", " ")}</Table.Td>
                <Table.Td>
                  <Text size="sm" fs="italic">
                    {row.peer} {row.peer_task}
                  </Text>
                </Table.Td>
                <Table.Td className="figures">{number(row.indicator_mean, 2)}</Table.Td>
                <Table.Td className="figures">{number(row.indicator_std, 2)}</Table.Td>
                <Table.Td className="figures">{number(row.indicator_best, 2)}</Table.Td>
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </Table.ScrollContainer>
    </details>
  );
}
