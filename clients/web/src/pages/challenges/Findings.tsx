import { Table } from "@mantine/core";
import { number } from "../../format";
import type { Report } from "./queries";

/** Every check of a package, and its score term by term. */
export function Findings({ report }: { report: Report }) {
  const terms = report.score?.terms ?? [];
  return (
    <Table.ScrollContainer
      minWidth={420}
      type="native"
      tabIndex={0}
      role="region"
      aria-label="What the checks say, scrolls sideways"
    >
      <Table fz="sm" aria-label="What the checks say" verticalSpacing={4}>
        <Table.Tbody>
          {report.findings.map(({ check, passed, sentence }) => (
            <Table.Tr key={check}>
              <Table.Th>{check}</Table.Th>
              <Table.Td>{passed ? "✓" : "✗"}</Table.Td>
              <Table.Td>{sentence}</Table.Td>
            </Table.Tr>
          ))}
          {terms.map(({ name, points, share, sentence }) => (
            <Table.Tr key={name}>
              <Table.Th>{name}</Table.Th>
              <Table.Td className="figures">
                {share === null ? "?" : number(points * share, 2)} of {number(points, 2)}
              </Table.Td>
              <Table.Td>{sentence}</Table.Td>
            </Table.Tr>
          ))}
        </Table.Tbody>
      </Table>
    </Table.ScrollContainer>
  );
}
