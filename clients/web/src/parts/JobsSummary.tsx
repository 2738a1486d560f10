import { Group, Progress, Stack, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import type { JobsSearch } from "../api/jobs-search";
import { jobSummary, type JobSummary } from "../api/queries";
import { count, counted, percent, stateWords, words } from "../format";
import { OUTCOME_COLOURS } from "../theme";

const SHOWN = 12;

interface Kind {
  key: string;
  label: string;
  colour: string;
  jobs: number;
  narrowed: JobsSearch;
}

/** Jobs that ended alike, success first; a running job counts by its state. */
export function kindsOf(summary: JobSummary, search: JobsSearch): Kind[] {
  return summary.endings
    .map(({ state, outcome, reason, jobs }) => {
      const name = outcome ?? state;
      const kind = reason === null ? stateWords(name) : `${stateWords(name)}: ${words(reason)}`;
      const narrowed: JobsSearch = {
        ...search,
        ...(outcome === null ? { state } : { outcome }),
        ...(reason === null ? {} : { reason }),
      };
      return { key: `${name} ${reason ?? ""}`, label: kind, colour: OUTCOME_COLOURS[name] ?? "gray", jobs, narrowed };
    })
    .sort((a, b) => Number(b.key.startsWith("success")) - Number(a.key.startsWith("success")) || b.jobs - a.jobs);
}

/** Summary above a list: how its jobs ended and why; each kind opens the jobs that it counts. */
export function JobsSummary({ search }: { search: JobsSearch }) {
  // How the list is sorted changes nothing of what it holds.
  const filters = { ...search, sort: undefined, order: undefined };
  const found = useQuery(jobSummary(filters)).data;
  if (found === undefined || found.jobs === 0) return null;
  const kinds = kindsOf(found, search);
  const flags = Object.entries(found.flags);
  return (
    <Stack gap={6} role="region" aria-label="How these jobs ended">
      <Progress.Root size={10} aria-hidden>
        {kinds.map((kind) => (
          <Progress.Section
            key={kind.key}
            value={(100 * kind.jobs) / found.jobs}
            color={kind.colour}
            withAria={false}
          />
        ))}
      </Progress.Root>
      <Group gap="xs">
        <Text size="sm" fw={600}>
          {found.all_counted ? "" : "more than "}
          {counted(found.jobs, "run")}:
        </Text>
        {kinds.slice(0, SHOWN).map((kind) => (
          <Link
            key={kind.key}
            to="/jobs"
            search={kind.narrowed}
            className="kind-chip"
            title={`Show these ${kind.jobs}`}
          >
            <span aria-hidden style={{ background: `var(--mantine-color-${kind.colour}-6)` }} />
            {kind.label} {count(kind.jobs)} ({percent(kind.jobs / found.jobs)})
          </Link>
        ))}
        {kinds.length > SHOWN && <Text size="sm">and {count(kinds.length - SHOWN)} other kinds</Text>}
        {flags.map(([flag, jobs]) => (
          <Link key={flag} to="/jobs" search={{ ...search, flag }} className="kind-chip" title={`Show these ${jobs}`}>
            ⚑ {words(flag)} {count(jobs)}
          </Link>
        ))}
      </Group>
    </Stack>
  );
}
