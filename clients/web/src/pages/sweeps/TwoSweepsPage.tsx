import { Group, Select, Stack, Table, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link, useNavigate } from "@tanstack/react-router";
import { sweepComparison, sweeps, type SweepComparison } from "../../api/queries";
import { count, number, percent, successes, trackLabel } from "../../format";
import { Interval } from "../../parts/Interval";
import { Section } from "../../parts/Section";
import { SortHead, useSorting } from "../../parts/SortHead";
import type { Values } from "../../parts/sorting";
import { Answered, Empty } from "../../parts/States";

const route = getRouteApi("/sweeps/compare");

/** Two sweeps side by side, in pairs of jobs with the same task and seed. */
export default function TwoSweepsPage() {
  const { a, b } = route.useSearch();
  return (
    <Stack gap="lg">
      <Title order={1}>Two sweeps</Title>
      <Choice a={a} b={b} />
      {a !== undefined && b !== undefined ? (
        <Compared a={a} b={b} />
      ) : (
        <Empty title="Choose two sweeps">What differs between their settings is then what is measured.</Empty>
      )}
    </Stack>
  );
}

function Choice({ a, b }: { a?: string; b?: string }) {
  const navigate = useNavigate({ from: "/sweeps/compare" });
  const known = (useQuery(sweeps()).data?.sweeps ?? []).map((sweep) => ({
    value: sweep.id,
    label: `${sweep.name} · ${sweep.id.slice(6, 14)}`,
  }));
  const choices = (id: string | undefined) =>
    id === undefined || known.some((one) => one.value === id) ? known : [...known, { value: id, label: id }];
  return (
    <Group gap="sm" align="end">
      {(
        [
          ["a", "First", a],
          ["b", "Second", b],
        ] as const
      ).map(([name, label, id]) => (
        <Select
          key={name}
          label={label}
          data={choices(id)}
          value={id ?? null}
          searchable
          w={{ base: "100%", sm: 340 }}
          onChange={(value) => {
            void navigate({ search: (before) => ({ ...before, [name]: value ?? undefined }), replace: true });
          }}
        />
      ))}
    </Group>
  );
}

function Compared({ a, b }: { a: string; b: string }) {
  const query = useQuery(sweepComparison(a, b));
  return (
    <Answered query={query} rows={8}>
      {(found) => (
        <>
          <Sides found={found} />
          {found.pairs.length === 0 && <Empty title="No model and task is in both">Nothing can be set in pairs.</Empty>}
          {found.pairs.map((pair) => (
            <Section
              key={`${pair.first} ${pair.second}`}
              title={pair.first === pair.second ? pair.first : `${pair.first} and ${pair.second}`}
            >
              <Differences pair={pair} />
              <Pairs pair={pair} />
            </Section>
          ))}
          {found.left_out.length > 0 && (
            <Text size="sm" className="dimmed">
              Left out: {found.left_out.map((one) => `${one.kind} ${one.name} (${one.why})`).join("; ")}.
            </Text>
          )}
        </>
      )}
    </Answered>
  );
}

function Sides({ found }: { found: SweepComparison }) {
  return (
    <Group gap="xl" align="start">
      {(
        [
          ["First", found.first],
          ["Second", found.second],
        ] as const
      ).map(([label, side]) => (
        <div key={label}>
          <Text size="xs" className="dimmed">
            {label}
          </Text>
          <Link to="/sweeps/$id" params={{ id: side.id }}>
            <b>{side.name}</b>
          </Link>
          <Text size="sm">{count(side.ended)} jobs ended</Text>
          {side.tracks.map((track) => (
            <Text key={track} size="xs" className="dimmed">
              {trackLabel(track)}
            </Text>
          ))}
        </div>
      ))}
    </Group>
  );
}

type Pair = SweepComparison["pairs"][number];

function signed(points: number): string {
  return `${points > 0 ? "+" : points < 0 ? "−" : ""}${Math.abs(100 * points).toFixed(0)}`;
}

const VALUES: Values<Pair["tasks"][number]> = {
  task: (row) => row.task,
  first: (row) => row.successes[0] / row.trials[0],
  second: (row) => row.successes[1] / row.trials[1],
  difference: (row) => row.difference,
  pairs: (row) => row.success?.pairs ?? 0,
  p: (row) => row.success_p,
  indicator: (row) => row.indicator_p,
};

function Differences({ pair }: { pair: Pair }) {
  const { rows, head } = useSorting(pair.tasks, VALUES);
  return (
    <>
      <Table.ScrollContainer minWidth={760} type="native">
        <Table className="sticky-first" aria-label={`Differences, ${pair.first}`}>
          <Table.Thead>
            <Table.Tr>
              <SortHead name="task" {...head}>
                Task
              </SortHead>
              <SortHead name="first" figures {...head}>
                First
              </SortHead>
              <SortHead name="second" figures {...head}>
                Second
              </SortHead>
              <SortHead name="difference" figures {...head}>
                Difference, percentage points, 95 %
              </SortHead>
              <SortHead name="pairs" figures {...head}>
                Pairs
              </SortHead>
              <SortHead name="p" figures {...head}>
                p, success
              </SortHead>
              <SortHead name="indicator" figures {...head}>
                p, indicator
              </SortHead>
            </Table.Tr>
          </Table.Thead>
          <Table.Tbody>
            {rows.map((task) => (
              <Table.Tr key={task.task}>
                <Table.Td style={{ whiteSpace: "nowrap" }}>
                  <Link className="quiet" to="/tasks/$name" params={{ name: task.task }}>
                    {task.task}
                  </Link>
                </Table.Td>
                {([0, 1] as const).map((side) => (
                  <Table.Td key={side} className="figures">
                    {percent(task.successes[side] / task.trials[side])} ({successes(task.successes[side])} of{" "}
                    {task.trials[side]})
                  </Table.Td>
                ))}
                <Table.Td>
                  <Group gap={8} wrap="nowrap">
                    <Interval
                      low={task.low}
                      high={task.high}
                      value={task.difference}
                      from={-1}
                      to={1}
                      label={`difference ${signed(task.difference)} points`}
                    />
                    <Text size="sm" className="figures" style={{ whiteSpace: "nowrap" }}>
                      {signed(task.difference)} ({signed(task.low)} to {signed(task.high)})
                    </Text>
                  </Group>
                </Table.Td>
                <Table.Td className="figures">{count(task.success?.pairs ?? 0)}</Table.Td>
                <Table.Td className="figures">{number(task.success_p, 3)}</Table.Td>
                <Table.Td className="figures">{number(task.indicator_p, 3)}</Table.Td>
              </Table.Tr>
            ))}
          </Table.Tbody>
        </Table>
      </Table.ScrollContainer>
      <Text size="xs" className="dimmed">
        First minus second. Tests on shared seeds, exact McNemar and Wilcoxon signed-rank, adjusted over the model’s
        tests (Holm).
      </Text>
    </>
  );
}

const MAX_PAIRS = 30;

function Pairs({ pair }: { pair: Pair }) {
  if (pair.differing.length === 0)
    return <Text size="sm">On every shared task and seed both succeeded, or both failed.</Text>;
  return (
    <details>
      <summary style={{ cursor: "pointer", fontSize: 14 }}>
        {count(pair.differing.length)} {pair.differing.length === 1 ? "pair" : "pairs"} where just one succeeded
      </summary>
      <ul>
        {pair.differing.slice(0, MAX_PAIRS).map((one) => (
          <li key={`${one.task} ${one.seed}`}>
            <Text size="sm">
              {one.task}, seed {one.seed}: the {one.first.success ? "first" : "second"} succeeded,{" "}
              <Link to="/jobs/$id" params={{ id: one.first.job }}>
                first, {number(one.first.indicator)}
              </Link>
              ,{" "}
              <Link to="/jobs/$id" params={{ id: one.second.job }}>
                second, {number(one.second.indicator)}
              </Link>
            </Text>
          </li>
        ))}
      </ul>
      {pair.differing.length > MAX_PAIRS && <Text size="sm">and {count(pair.differing.length - MAX_PAIRS)} more</Text>}
    </details>
  );
}
