import { Badge, Group, Table, Text } from "@mantine/core";
import { Link } from "@tanstack/react-router";
import { useVirtualizer } from "@tanstack/react-virtual";
import { memo, useRef } from "react";
import type { Job } from "../api/queries";
import { counted, dollars, duration, number, secondsBetween, words } from "../format";
import { RelativeTime } from "./RelativeTime";
import { OutcomeBadge } from "./Outcome";
import { Heads } from "./SortHead";
import type { Columns, Sorting } from "./sorting";

const ROW_PX = 41;
const HEIGHT_PX = 620;

/** The service sorts by figures and times. */
const COLUMNS: Columns<Job> = [
  { name: "job", label: "Job" },
  { name: "task", label: "Task" },
  { name: "model", label: "Model" },
  { name: "seed", label: "Seed", figures: true },
  { name: "outcome", label: "State" },
  { name: "indicator", label: "Result", value: (job) => job.indicator, figures: true },
  { name: "cost", label: "Cost", value: (job) => job.usage.cost_usd, figures: true },
  { name: "took", label: "Took", figures: true },
  { name: "finished", label: "Ended", value: (job) => job.finished_at, figures: true },
];

interface Listed {
  jobs: readonly Job[];
  onEnd: () => void;
  sorting: Sorting | null;
  onSort: (to: Sorting) => void;
}

/** A list of jobs of any length, as the service sorted it: only the rows in sight are drawn. */
export function JobsTable({ jobs, onEnd, sorting, onSort }: Listed) {
  const frame = useRef<HTMLDivElement>(null);
  const rows = useVirtualizer({
    count: jobs.length,
    getScrollElement: () => frame.current,
    estimateSize: () => ROW_PX,
    overscan: 6,
    onChange: (instance) => {
      const last = instance.getVirtualItems().at(-1);
      if (last !== undefined && last.index >= jobs.length - 5) onEnd();
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
      aria-label={`${counted(jobs.length, "job")}, scrolls`}
    >
      <Table stickyHeader highlightOnHover miw={940} aria-rowcount={jobs.length + 1}>
        <Table.Thead>
          <Heads columns={COLUMNS} sorting={sorting} onSort={onSort} />
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
        <RelativeTime time={job.finished_at} />
      </Table.Td>
    </Table.Tr>
  );
});
