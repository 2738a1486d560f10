import { Button, Group, Select, Stack, Text, Title } from "@mantine/core";
import { useInfiniteQuery, useQuery } from "@tanstack/react-query";
import { getRouteApi, useNavigate } from "@tanstack/react-router";
import { taken } from "../../api/client";
import { jobPage, models, tasks } from "../../api/queries";
import { every } from "../../api/site";
import { words } from "../../format";
import { JobsTable } from "../../parts/JobsTable";
import { ProblemNote } from "../../parts/Problem";
import { Empty, Loading, Stale } from "../../parts/States";
import type { JobsSearch } from "../../api/jobs-search";

const route = getRouteApi("/jobs");
const PAGE = 200;
const LONGEST = 34;
const REFRESH_MS = 10_000;
const OUTCOMES = ["success", "unsuccessful", "construction_failed", "limit", "errored", "cancelled"];
const STATES = ["queued", "running", "on_hold", "done"];

/** Jobs, filtered by what the address says. */
export default function JobsPage() {
  const search = route.useSearch();
  const query = useInfiniteQuery({
    queryKey: ["jobs", search],
    queryFn: ({ pageParam }) => taken(jobPage({ ...search, limit: PAGE, cursor: pageParam })),
    initialPageParam: undefined as string | undefined,
    getNextPageParam: (page) => page.next_cursor ?? undefined,
    refetchInterval: (running) => (running.state.data?.pages.length ?? 1) === 1 && every(REFRESH_MS),
  });
  const jobs = (query.data?.pages ?? []).flatMap((page) => page.jobs);
  const more = (): void => {
    if (query.hasNextPage && !query.isFetching) void query.fetchNextPage();
  };
  return (
    <Stack gap="md">
      <Title order={1}>Jobs</Title>
      <Filters search={search} />
      {query.isError && query.data === undefined && (
        <ProblemNote error={query.error} retry={() => void query.refetch()} />
      )}
      {query.isError && query.data !== undefined && <Stale since={query.dataUpdatedAt} />}
      {query.isPending && <Loading rows={10} />}
      {query.data !== undefined && jobs.length === 0 && (
        <Empty title="No job is like that">Take a filter away to see more.</Empty>
      )}
      {jobs.length > 0 && (
        <>
          <JobsTable jobs={jobs} onEnd={more} />
          <Group>
            <Text size="sm" className="dimmed">
              {jobs.length.toLocaleString("en")} jobs, newest first{query.hasNextPage ? ", and more" : ""}
            </Text>
            {query.hasNextPage && (
              <Button size="xs" variant="default" loading={query.isFetchingNextPage} onClick={more}>
                Read more
              </Button>
            )}
          </Group>
        </>
      )}
    </Stack>
  );
}

function Filters({ search }: { search: JobsSearch }) {
  const navigate = useNavigate({ from: "/jobs" });
  const known = { tasks: useQuery(tasks()), models: useQuery(models()) };
  const choices: readonly [keyof JobsSearch, string, string[]][] = [
    ["task", "Task", (known.tasks.data ?? []).map((one) => one.name)],
    ["model", "Model", (known.models.data ?? []).map((one) => one.name)],
    ["state", "State", STATES],
    ["outcome", "Outcome", OUTCOMES],
  ];
  const others = (
    ["sweep", "reason", "flag", "track", "task_version", "configuration", "since", "until"] as const
  ).filter((name) => search[name] !== undefined && search[name] !== null);
  const set = (name: keyof JobsSearch, value: string | null): void => {
    void navigate({ search: (before) => ({ ...before, [name]: value ?? undefined }), replace: true });
  };
  return (
    <Group align="end" gap="sm">
      {choices.map(([name, label, data]) => (
        <Select
          key={name}
          label={label}
          data={[...new Set([...data, ...(search[name] ? [search[name]] : [])])].map((value) => ({
            value,
            label: words(value),
          }))}
          value={search[name] ?? null}
          placeholder="all"
          clearable
          searchable
          clearButtonProps={{ "aria-label": `Every ${name}` }}
          w={190}
          onChange={(value) => {
            set(name, value);
          }}
        />
      ))}
      {others.map((name) => (
        <Button
          key={name}
          variant="light"
          onClick={() => {
            set(name, null);
          }}
        >
          {words(name)}: {(search[name] ?? "").slice(0, LONGEST)} ✕
        </Button>
      ))}
    </Group>
  );
}
