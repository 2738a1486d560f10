import { Badge, Group, Stack, Text, Title } from "@mantine/core";
import { useQuery, useQueryClient } from "@tanstack/react-query";
import { getRouteApi } from "@tanstack/react-router";
import { useCallback, useEffect, useRef, useState } from "react";
import { useEvents, type StreamState } from "../../api/events";
import { board, sweep as sweepQuery, type Sweep } from "../../api/queries";
import { every, isSite } from "../../api/site";
import { RelativeTime } from "../../parts/RelativeTime";
import type { Sorting } from "../../parts/sorting";
import { Section } from "../../parts/Section";
import { Answered } from "../../parts/States";
import { entriesOf } from "../board/entries";
import { HeatMap } from "../board/HeatMap";
import { JobsList } from "../jobs/JobsList";
import type { JobsSearch } from "../../api/jobs-search";
import { Actions } from "./Actions";
import { SweepFacts } from "./SweepFacts";
import { OutcomeBar, SweepState } from "./SweepsPage";
import { FaultList } from "./FaultList";

const route = getRouteApi("/sweeps/$id");
const READ_MS = 1_000;

const isOpen = ({ progress }: Sweep): boolean => progress.done < progress.total;

/** A sweep, live: what events say has happened is read again. */
export default function SweepPage() {
  const { id } = route.useParams();
  const query = useQuery({
    ...sweepQuery(id),
    refetchInterval: (running) => every(running.state.data?.state === "active" ? 10_000 : 30_000),
  });
  const stream = useReading(id, query.data);
  const [sorting, setSorting] = useState<Sorting>({ by: "finished", descending: true });
  const { by, descending } = sorting;
  const search: JobsSearch = { sweep: id, sort: by as JobsSearch["sort"], order: descending ? undefined : "asc" };
  return (
    <Answered query={query} rows={10}>
      {(sweep) => (
        <Stack gap="lg">
          <Head sweep={sweep} stream={stream} />
          <SweepFacts sweep={sweep} />
          <FaultList sweep={sweep} />
          {!isSite && sweep.progress.done > 0 && <Grid id={id} />}
          <Section title="Jobs">
            <JobsList search={search} onSort={setSorting} />
          </Section>
        </Stack>
      )}
    </Answered>
  );
}

/** Listens to an open sweep; at most once a second everything that shows it is read again. */
function useReading(id: string, sweep: Sweep | undefined): StreamState {
  const queries = useQueryClient();
  const waiting = useRef<ReturnType<typeof setTimeout> | null>(null);
  const read = useCallback((): void => {
    waiting.current ??= setTimeout(() => {
      waiting.current = null;
      void queries.invalidateQueries();
    }, READ_MS);
  }, [queries]);
  useEffect(
    () => () => {
      if (waiting.current !== null) clearTimeout(waiting.current);
      waiting.current = null;
    },
    [],
  );
  const open = sweep !== undefined && isOpen(sweep);
  return useEvents(open ? `/v1/sweeps/${encodeURIComponent(id)}/events` : null, read, sweep?.last_event);
}

function Head({ sweep, stream }: { sweep: Sweep; stream: StreamState }) {
  return (
    <Stack gap={6}>
      <Group justify="space-between" align="start">
        <div>
          <Group gap="sm">
            <Title order={1}>{sweep.name}</Title>
            <SweepState state={sweep.state} />
            {!isSite && isOpen(sweep) && <LiveMark state={stream} />}
          </Group>
          <Text size="sm" className="dimmed">
            {sweep.id}, submitted <RelativeTime time={sweep.created_at} />
          </Text>
        </div>
        <Actions sweep={sweep} />
      </Group>
      <OutcomeBar sweep={sweep} size={16} />
    </Stack>
  );
}

function LiveMark({ state }: { state: StreamState }) {
  const [label, colour] = {
    live: ["live", "teal"],
    connecting: ["connecting", "gray"],
    broken: ["not live: connecting again", "yellow"],
  }[state] as [string, string];
  return (
    <Badge variant="dot" color={colour} tt="none" role="status">
      {label}
    </Badge>
  );
}

/** How often each model has succeeded on each task up to now. */
function Grid({ id }: { id: string }) {
  const query = useQuery(board({ sweep: id }));
  return (
    <Section title="Model by task">
      <Answered query={query}>{(found) => <HeatMap board={found} entries={entriesOf(found, true)} />}</Answered>
    </Section>
  );
}
