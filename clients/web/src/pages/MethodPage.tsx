import { Group, List, Stack, Table, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import type { ReactNode } from "react";
import { tasks, versions } from "../api/queries";
import { count, percent } from "../format";
import { Section } from "../parts/Section";
import { Answered } from "../parts/States";

/** What is measured, how ranks and intervals come about, and what is not claimed. */
export default function MethodPage() {
  const known = useQuery(tasks());
  const query = useQuery(versions());
  const paper = known.data?.filter((task) => ["support", "transport", "lift"].includes(task.category)).length;
  return (
    <Stack gap="lg" maw={860}>
      <div>
        <Title order={1}>Method</Title>
        <Text size="sm" className="dimmed">
          What the boards measure, how ranks and intervals come about, and what they do not claim.
        </Text>
      </div>
      <Answered query={query} rows={10}>
        {(used) => (
          <>
            <Section title="What is measured">
              <Points>
                <>
                  A model builds a machine, block by block, through a library that checks each action and says what it
                  refuses. A simulator runs the machine once it is finished, and the task’s scorer reads the trial.
                </>
                <>
                  Each task has one <b>indicator</b>: the load a bridge carries, the distance a vehicle drives, a
                  rocket’s thrust over its weight. <b>Success</b> is whether the machine did what the task says.{" "}
                  {known.data !== undefined && (
                    <>
                      There are {count(known.data.length)} <Link to="/tasks">tasks</Link>, {count(paper)} in the paper’s
                      three categories.
                    </>
                  )}
                </>
                <>
                  A failure counts, with an indicator of 0, whether the machine was never finished or its trial failed.
                  Jobs that faults of infrastructure ended, and cancelled ones, are in no average; both numbers are
                  shown.
                </>
                <>
                  Where a track has varied worlds, a finished machine is tried again in worlds that differ as a fair
                  repetition would, drawn after it was finished. The job’s success is the share of worlds in which it
                  works.
                </>
                <>
                  A <b>flag</b> is a remark on a trial. A disqualifying one says that the machine did not do what the
                  task asks, and makes the trial a failure.
                </>
              </Points>
            </Section>
            <Section title="How ranks come about">
              <Points>
                <>
                  On each task a model has two ranks, by success rate and by indicator. Their mean over all tasks orders
                  the board. Parts and cost never enter.
                </>
                <>
                  Each pair of models has a permutation test on each task, and one over all tasks. All claims of a board
                  are one family, adjusted together (Holm): at most {percent(used.family_wise_error_rate)} of boards
                  make any false claim.
                </>
                <>
                  A model’s <b>rank</b> is one more than the number of models that are better beyond chance. Models that
                  the trials do not tell apart are <b>tied</b> and share it. The interval of its <b>place</b> holds
                  every place that the claims leave open; all intervals of a board hold together.
                </>
                <>Only a model with counted jobs on every task of a ranking is ranked in it.</>
              </Points>
            </Section>
            <Section title="How intervals come about">
              <Points>
                <>
                  Of a success rate: the exact interval of Clopper and Pearson, which covers at least{" "}
                  {percent(1 - used.family_wise_error_rate)} at every rate.
                </>
                <>
                  Of a mean indicator: the successes’ share and their mean, each with its own interval, combined. Below{" "}
                  {count(used.min_successes)} successes there is none, as none would hold: “too few data”.
                </>
                <>
                  The <b>score</b> compares a job’s indicator with that of the built-in expert: 0 for nothing, 1 for as
                  much, 2 for three times as much. It does not depend on who else is listed.
                </>
                <>
                  Two models are compared on the seeds that both have: exact McNemar for success, Wilcoxon’s signed
                  ranks for the indicator.
                </>
              </Points>
            </Section>
            <Section title="What is not claimed">
              <Points>
                <>
                  That tied models are equally good: only that these trials do not show which is better. The sentence on
                  top of a board says how many seeds might.
                </>
                <>
                  That a result holds on another track: another simulator, workflow, prompts or version is another
                  ranking, and they are never mixed.
                </>
                <>
                  That a simulated machine works in the world, or in the game: engines approximate it, each in its own
                  way.
                </>
                <>That ours and the paper’s figures compare: the paper’s were measured in the game.</>
                <>That a rank says how useful a model is for anything but building these machines in this way.</>
              </Points>
            </Section>
            <Section title="Versions in use">
              <Text size="sm" mb="xs">
                Results of different versions are never compared; each job lists its own in its manifest.
              </Text>
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
              <Group mt="xs">
                <Text size="xs" className="dimmed">
                  The sources of every figure, and the tables of coverage and power, are in docs/statistics.md.
                </Text>
              </Group>
            </Section>
          </>
        )}
      </Answered>
    </Stack>
  );
}

function Points({ children }: { children: readonly ReactNode[] }) {
  return (
    <List size="sm" spacing={6}>
      {children.map((point, index) => (
        <List.Item key={index}>{point}</List.Item>
      ))}
    </List>
  );
}
