import { SegmentedControl, Stack, Table, Tabs, Text } from "@mantine/core";
import { useQueries } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { lazy, Suspense, useState } from "react";
import { job as jobQuery, type JobDetail } from "../../api/queries";
import { OutcomeBadge } from "../../parts/Outcome";
import { ProblemNote } from "../../parts/Problem";
import { Section } from "../../parts/Section";
import { Loading } from "../../parts/States";
import { rolloutsOf } from "../job/queries";
import { Transcripts } from "./Transcripts";
import { factsOf } from "./facts";

const Builds = lazy(() => import("./Builds"));
const Trials = lazy(() => import("./Trials"));

/** Two jobs side by side: facts, builds, trials, transcripts. */
export function ComparedJobs({ ids }: { ids: readonly [string, string] }) {
  const [first, second] = useQueries({ queries: [jobQuery(ids[0]), jobQuery(ids[1])] });
  const error = first.error ?? second.error;
  if (error !== null)
    return (
      <ProblemNote
        error={error}
        retry={() => {
          void first.refetch();
          void second.refetch();
        }}
      />
    );
  if (first.data === undefined || second.data === undefined) return <Loading rows={10} />;
  return <Both jobs={[first.data, second.data]} />;
}

function Both({ jobs }: { jobs: readonly [JobDetail, JobDetail] }) {
  const tried = jobs.every((job) => rolloutsOf(job.artifacts).length > 0);
  const [differing, setDiffering] = useState("differing");
  const facts = factsOf(...jobs);
  const shown = differing === "all" ? facts : facts.filter((fact) => fact.a !== fact.b);
  return (
    <Stack gap="lg">
      <Section
        title="Facts"
        aside={
          <SegmentedControl
            size="xs"
            aria-label="Which facts"
            value={differing}
            onChange={setDiffering}
            data={[
              { value: "all", label: "All" },
              { value: "differing", label: "Only what differs" },
            ]}
          />
        }
      >
        <div style={{ overflowX: "auto" }} tabIndex={0} role="region" aria-label="Facts of both jobs, scrolls">
          <Table miw={300} style={{ overflowWrap: "anywhere" }}>
            <Table.Thead>
              <Table.Tr>
                <Table.Th>Fact</Table.Th>
                {jobs.map((job, index) => (
                  <Table.Th key={index}>
                    <Link to="/jobs/$id" params={{ id: job.id }}>
                      {["A", "B"][index]}: {job.task} by {job.model}, seed {job.seed}
                    </Link>{" "}
                    <OutcomeBadge value={job.outcome ?? job.state} size="sm" />
                  </Table.Th>
                ))}
              </Table.Tr>
            </Table.Thead>
            <Table.Tbody>
              {shown.map(({ name, a, b }) => (
                <Table.Tr key={name}>
                  <Table.Th scope="row" fw={500} style={{ overflowWrap: "normal" }}>
                    {name}
                  </Table.Th>
                  <Table.Td className={a === b ? "dimmed" : "differs"}>{a}</Table.Td>
                  <Table.Td className={a === b ? "dimmed" : "differs"}>{b}</Table.Td>
                </Table.Tr>
              ))}
            </Table.Tbody>
          </Table>
        </div>
        {jobs[0].task !== jobs[1].task && (
          <Text size="sm">They are of different tasks, so their indicators say nothing about each other.</Text>
        )}
      </Section>
      <Section title="Machines">
        <Tabs defaultValue="builds" keepMounted={false}>
          <Tabs.List mb="sm">
            <Tabs.Tab value="builds">Builds, step by step</Tabs.Tab>
            <Tabs.Tab value="trials" disabled={!tried}>
              Trials, by one clock
            </Tabs.Tab>
          </Tabs.List>
          <Suspense fallback={<Loading rows={10} />}>
            <Tabs.Panel value="builds">
              <Builds jobs={jobs} />
            </Tabs.Panel>
            <Tabs.Panel value="trials">
              <Trials jobs={jobs} />
            </Tabs.Panel>
          </Suspense>
        </Tabs>
      </Section>
      <Section title="What was done">
        <Transcripts jobs={jobs} />
      </Section>
    </Stack>
  );
}
