import { Button, Group, Stack, Text, Title } from "@mantine/core";
import { useInfiniteQuery } from "@tanstack/react-query";
import { getRouteApi, useNavigate } from "@tanstack/react-router";
import { jobPage } from "../../api/queries";
import { every, isSite } from "../../api/site";
import { JobsTable } from "../../parts/JobsTable";
import { JobsSummary } from "../../parts/JobsSummary";
import { ProblemNote } from "../../parts/Problem";
import type { Sorting } from "../../parts/sorting";
import { Empty, Loading, Stale } from "../../parts/States";
import type { JobsSearch } from "../../api/jobs-search";
import { Filters } from "./Filters";
import { Said } from "./Said";

const route = getRouteApi("/jobs");
const REFRESH_MS = 10_000;

function sortingOf({ sort, order }: JobsSearch): Sorting | null {
  return sort === undefined ? null : { by: sort, descending: order !== "asc" };
}

/** Jobs, filtered and sorted by what the address says. */
export default function JobsPage() {
  const search = route.useSearch();
  const navigate = useNavigate({ from: "/jobs" });
  const query = useInfiniteQuery({
    queryKey: ["jobs", search],
    queryFn: ({ pageParam }) => jobPage({ ...search, cursor: pageParam }),
    initialPageParam: undefined as string | undefined,
    getNextPageParam: (page) => page.next_cursor ?? undefined,
    refetchInterval: (running) => (running.state.data?.pages.length ?? 1) === 1 && every(REFRESH_MS),
  });
  const jobs = (query.data?.pages ?? []).flatMap((page) => page.data);
  const more = (): void => {
    if (query.hasNextPage && !query.isFetching) void query.fetchNextPage();
  };
  const sort = ({ by, descending }: Sorting): void => {
    void navigate({
      search: (before) => ({
        ...before,
        sort: by as JobsSearch["sort"],
        order: descending ? undefined : "asc",
      }),
      replace: true,
      resetScroll: false,
    });
  };
  return (
    <Stack gap="md">
      <Title order={1}>Jobs</Title>
      <Filters search={search} />
      {!isSite && <Said />}
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
          <JobsSummary search={search} />
          <JobsTable jobs={jobs} onEnd={more} sorting={sortingOf(search)} onSort={sort} />
          <Group>
            <Text size="sm" className="dimmed">
              {jobs.length.toLocaleString("en")} {jobs.length === 1 ? "job" : "jobs"}
              {search.sort === undefined ? ", newest first" : ""}
              {query.hasNextPage ? ", and more" : ""}
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
