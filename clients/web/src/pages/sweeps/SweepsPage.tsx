import { Badge, Button, Group, Progress, Stack, Table, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import { sweeps, type Sweep } from "../../api/queries";
import { isSite } from "../../api/site";
import { count, dollars, stateWords, words } from "../../format";
import { RelativeTime } from "../../parts/RelativeTime";
import { has, useCaller } from "../../parts/permissions";
import { Heads, useSorting } from "../../parts/SortHead";
import type { Columns } from "../../parts/sorting";
import { Answered, Empty } from "../../parts/States";
import { OUTCOME_COLOURS } from "../../theme";

export const SWEEP_COLOURS: Readonly<Record<string, string>> = {
  active: "blue",
  paused: "yellow",
  budget_exhausted: "orange",
  cancelled: "gray",
  done: "teal",
};

/** Sweeps, the newest first. */
export default function SweepsPage() {
  const [cursors, setCursors] = useState<readonly string[]>([]);
  const query = useQuery(sweeps(cursors.at(-1)));
  const who = useCaller();
  return (
    <Stack gap="md">
      <Group justify="space-between">
        <Title order={1}>Sweeps</Title>
        <Group>
          <Link to="/jobs">All jobs</Link>
          {has(who, "submit") && (
            <Button size="xs" renderRoot={(props) => <Link to="/sweeps/new" {...props} />}>
              New sweep
            </Button>
          )}
        </Group>
      </Group>
      <Answered query={query}>
        {(page) =>
          page.data.length === 0 && isSite ? (
            <Empty title="This site holds a track, and no sweeps" />
          ) : page.data.length === 0 ? (
            <Empty title="Nobody has submitted a sweep">
              <code>buildarena sweep run examples/sweeps/baselines.yaml</code> submits one.
            </Empty>
          ) : (
            <Table.ScrollContainer minWidth={720} type="native">
              <SweepRows sweeps={page.data} />
              <Group mt="sm" gap="xs">
                {cursors.length > 0 && (
                  <Button size="xs" variant="default" onClick={() => setCursors(cursors.slice(0, -1))}>
                    Newer
                  </Button>
                )}
                {page.next_cursor !== null && (
                  <Button size="xs" variant="default" onClick={() => setCursors([...cursors, page.next_cursor ?? ""])}>
                    Older
                  </Button>
                )}
              </Group>
            </Table.ScrollContainer>
          )
        }
      </Answered>
    </Stack>
  );
}

const COLUMNS: Columns<Sweep> = [
  { name: "name", label: "Sweep", value: (row) => row.name },
  { name: "state", label: "State", value: (row) => row.state },
  { name: "progress", label: "Progress", value: (row) => row.progress.done / Math.max(1, row.progress.total) },
  { name: "jobs", label: "Jobs", value: (row) => row.progress.total, figures: true },
  { name: "spent", label: "Spent", value: (row) => row.progress.usage.cost_usd, figures: true },
  { name: "submitted", label: "Submitted", value: (row) => row.created_at },
];

function SweepRows({ sweeps: listed }: { sweeps: readonly Sweep[] }) {
  const { rows, head } = useSorting(listed, COLUMNS);
  return (
    <Table highlightOnHover verticalSpacing="sm">
      <Table.Thead>
        <Heads {...head} />
      </Table.Thead>
      <Table.Tbody>
        {rows.map((sweep) => (
          <SweepRow key={sweep.id} sweep={sweep} />
        ))}
      </Table.Tbody>
    </Table>
  );
}

export function SweepState({ state }: { state: string }) {
  return (
    <Badge
      variant="outline"
      color={SWEEP_COLOURS[state] ?? "gray"}
      tt="none"
      styles={{ root: { color: "var(--mantine-color-text)", minWidth: "max-content" } }}
    >
      {stateWords(state)}
    </Badge>
  );
}

/** A bar of how a sweep's jobs ended; its label says it in figures. */
export function OutcomeBar({ sweep, size = 12 }: { sweep: Sweep; size?: number }) {
  const { total, outcomes } = sweep.progress;
  const places = Object.keys(OUTCOME_COLOURS);
  const parts = Object.entries(outcomes).sort(([one], [another]) => places.indexOf(one) - places.indexOf(another));
  const label = `${sweep.progress.done} of ${total} ended: ${parts.map(([name, n]) => `${n} ${words(name)}`).join(", ")}`;
  return (
    <Progress.Root size={size} role="img" aria-label={label} title={label}>
      {parts.map(([name, n]) => (
        <Progress.Section
          key={name}
          value={(100 * n) / Math.max(1, total)}
          color={OUTCOME_COLOURS[name] ?? "gray"}
          withAria={false}
        />
      ))}
    </Progress.Root>
  );
}

function SweepRow({ sweep }: { sweep: Sweep }) {
  return (
    <Table.Tr>
      <Table.Td>
        <Link className="quiet" to="/sweeps/$id" params={{ id: sweep.id }}>
          <b>{sweep.name}</b>
        </Link>
        <Text size="xs" ff="monospace" className="dimmed">
          {sweep.id}
        </Text>
      </Table.Td>
      <Table.Td>
        <SweepState state={sweep.state} />
      </Table.Td>
      <Table.Td w="30%">
        <OutcomeBar sweep={sweep} />
      </Table.Td>
      <Table.Td className="figures">
        {count(sweep.progress.done)} of {count(sweep.progress.total)}
      </Table.Td>
      <Table.Td className="figures">
        {dollars(sweep.progress.usage.cost_usd)}
        {sweep.budget?.max_cost_usd != null && (
          <Text span size="xs" className="dimmed">
            {" "}
            of {dollars(sweep.budget.max_cost_usd)}
          </Text>
        )}
      </Table.Td>
      <Table.Td>
        <Group gap={4}>
          <RelativeTime time={sweep.created_at} />
        </Group>
      </Table.Td>
    </Table.Tr>
  );
}
