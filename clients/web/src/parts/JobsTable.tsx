import { Badge, Group, Table, Text } from "@mantine/core";
import { Link } from "@tanstack/react-router";
import { useVirtualizer } from "@tanstack/react-virtual";
import { memo, useRef, useState } from "react";
import type { Job } from "../api/queries";
import { dollars, duration, number, secondsBetween, words } from "../format";
import { Ago } from "./Ago";
import { OutcomeBadge } from "./Outcome";
import { SortHead } from "./SortHead";
import { sortedRows, type Sorting, type Values } from "./sorting";

const ROW_PX = 41;
const HEIGHT_PX = 620;

const VALUES: Values<Job> = {
  task: (job) => job.task,
  model: (job) => job.model,
  seed: (job) => job.seed,
  outcome: (job) => job.outcome ?? job.state,
  indicator: (job) => job.indicator,
  cost: (job) => job.usage.cost_usd,
  finished: (job) => job.finished_at,
};

interface Listed {
  jobs: readonly Job[];
  onEnd?: () => void;
  /** How the service sorted them, where it does; rows that are all here are sorted here. */
  sorting?: Sorting | null;
  onSort?: (to: Sorting) => void;
}

/** A list of jobs of any length: only the rows in sight are drawn. */
export function JobsTable({ jobs: listed, onEnd, sorting: asked, onSort }: Listed) {
  const [own, setOwn] = useState<Sorting | null>(null);
  const jobs = onSort === undefined ? sortedRows(listed, own, VALUES) : listed;
  const head = { sorting: onSort === undefined ? own : (asked ?? null), onSort: onSort ?? setOwn };
  // The service sorts by no words.
  const word = onSort === undefined ? head : { sorting: null };
  const frame = useRef<HTMLDivElement>(null);
  const rows = useVirtualizer({
    count: jobs.length,
    getScrollElement: () => frame.current,
    estimateSize: () => ROW_PX,
    overscan: 6,
    onChange: (instance) => {
      const last = instance.getVirtualItems().at(-1);
      if (last !== undefined && last.index >= jobs.length - 5) onEnd?.();
    },
  });
  const shown = rows.getVirtualItems();
  const before = shown[0]?.start ?? 0;
  const after = rows.getTotalSize() - (shown.at(-1)?.end ?? 0);
  return (
    <div
      ref={frame}
      style={{ overflow: "auto", maxHeight: HEIGHT_PX }}
      tabIndex={0}
      role="region"
      aria-label={`${jobs.length} jobs, scrolls`}
    >
      <Table stickyHeader highlightOnHover miw={940} aria-rowcount={jobs.length + 1}>
        <Table.Thead>
          <Table.Tr>
            <Table.Th>Job</Table.Th>
            <SortHead name="task" {...word}>
              Task
            </SortHead>
            <SortHead name="model" {...word}>
              Model
            </SortHead>
            <SortHead name="seed" figures {...word}>
              Seed
            </SortHead>
            <SortHead name="outcome" {...word}>
              State
            </SortHead>
            <SortHead name="indicator" figures {...head}>
              Result
            </SortHead>
            <SortHead name="cost" figures {...head}>
              Cost
            </SortHead>
            <Table.Th className="figures">Took</Table.Th>
            <SortHead name="finished" figures {...head}>
              Ended
            </SortHead>
          </Table.Tr>
        </Table.Thead>
        <Table.Tbody>
          {before > 0 && <tr style={{ height: before }} aria-hidden />}
          {shown.map((item) => {
            const job = jobs[item.index];
            return job === undefined ? null : <JobRow key={job.id} job={job} index={item.index} />;
          })}
          {after > 0 && <tr style={{ height: after }} aria-hidden />}
        </Table.Tbody>
      </Table>
    </div>
  );
}

/** Drawn again only when its job changes: a list that lives has many that do not. */
const JobRow = memo(function JobRow({ job, index }: { job: Job; index: number }) {
  return (
    <Table.Tr style={{ height: ROW_PX }} aria-rowindex={index + 2}>
      <Table.Td>
        <Link to="/jobs/$id" params={{ id: job.id }} className="quiet">
          <Text span size="xs" ff="monospace">
            {job.id.slice(0, 12)}…
          </Text>
        </Link>
      </Table.Td>
      <Table.Td style={{ whiteSpace: "nowrap" }}>{job.task}</Table.Td>
      <Table.Td style={{ whiteSpace: "nowrap" }}>{job.model}</Table.Td>
      <Table.Td className="figures">{job.seed}</Table.Td>
      <Table.Td>
        <Group gap={6} wrap="nowrap">
          <OutcomeBadge value={job.outcome ?? job.state} size="sm" />
          {job.reason !== null && (
            <Text size="xs" className="dimmed" truncate maw={180}>
              {words(job.reason)}
            </Text>
          )}
          {job.flags.length > 0 && (
            <Badge size="sm" color="yellow" variant="outline" tt="none" styles={{ root: { color: "inherit" } }}>
              {job.flags.length} flag{job.flags.length > 1 ? "s" : ""}
            </Badge>
          )}
        </Group>
      </Table.Td>
      <Table.Td className="figures">
        {job.censored ? "≥ " : ""}
        {number(job.indicator)}
      </Table.Td>
      <Table.Td className="figures">{dollars(job.usage.cost_usd)}</Table.Td>
      <Table.Td className="figures">{duration(secondsBetween(job.started_at, job.finished_at))}</Table.Td>
      <Table.Td className="figures">
        <Ago time={job.finished_at} />
      </Table.Td>
    </Table.Tr>
  );
});
