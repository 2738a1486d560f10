import { Stack, Table, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { tasks, versions } from "../api/queries";
import { count, percent } from "../format";
import { Markdown } from "../parts/Markdown";
import { Section } from "../parts/Section";
import { Answered } from "../parts/States";
import method from "./method.md?raw";

/** What is measured, how ranks and intervals come about, and what is not claimed. */
export default function MethodPage() {
  const known = useQuery(tasks()).data;
  const query = useQuery(versions());
  return (
    <Stack gap="lg" maw={860}>
      <Title order={1}>Method</Title>
      <Answered query={query} rows={10}>
        {(used) => {
          const figures: Readonly<Record<string, string>> = {
            tasks: count(known?.length),
            error: percent(used.family_wise_error_rate),
            covered: percent(1 - used.family_wise_error_rate),
            successes: count(used.min_successes),
          };
          return (
            <>
              <Markdown text={method.replace(/\{(\w+)\}/g, (_, name: string) => figures[name] ?? name)} />
              <Section title="Versions in use">
                <Table fz="sm" maw={420} aria-label="Versions in use">
                  <Table.Tbody>
                    {[
                      ["Service", used.buildarena],
                      ["Feedback to builders", used.feedback],
                      ["Scorers", String(used.scorers)],
                      ...used.simulators.map(({ name, version }) => [`Simulator ${name}`, version]),
                    ].map(([name, version]) => (
                      <Table.Tr key={name}>
                        <Table.Th scope="row" fw={500}>
                          {name}
                        </Table.Th>
                        <Table.Td className="figures">{version}</Table.Td>
                      </Table.Tr>
                    ))}
                  </Table.Tbody>
                </Table>
              </Section>
            </>
          );
        }}
      </Answered>
    </Stack>
  );
}
