import { Button, Group, Stack, Text } from "@mantine/core";
import { useInfiniteQuery } from "@tanstack/react-query";
import type { JobsSearch } from "../../api/jobs-search";
import { jobPage } from "../../api/queries";
import { every } from "../../api/site";
import { counted } from "../../format";
import { JobsSummary } from "../../parts/JobsSummary";
import { JobsTable } from "../../parts/JobsTable";
import { ProblemNote } from "../../parts/Problem";
import type { Sorting } from "../../parts/sorting";
import { Empty, Loading, Stale } from "../../parts/States";

const REFRESH_MS = 10_000;

interface JobsListProps {
  search: JobsSearch;
  onSort: (to: Sorting) => void;
}

/** The jobs that an address chooses, page after page, with what they come to. */
export function JobsList({ search, onSort }: JobsListProps) {
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
  const sorting = search.sort === undefined ? null : { by: search.sort, descending: search.order !== "asc" };
  if (query.isPending) return <Loading rows={10} />;
  if (query.data === undefined) return <ProblemNote error={query.error} retry={() => void query.refetch()} />;
  if (jobs.length === 0) return <Empty title="No job is like that">Take a filter away to see more.</Empty>;
  return (
    <Stack gap="sm">
      {query.isError && <Stale since={query.dataUpdatedAt} />}
      <JobsSummary search={search} />
      <JobsTable jobs={jobs} onEnd={more} sorting={sorting} onSort={onSort} />
      <Group>
        <Text size="sm" className="dimmed">
          {counted(jobs.length, "job")}
          {search.sort === undefined ? ", newest first" : ""}
          {query.hasNextPage ? ", and more" : ""}
        </Text>
        {query.hasNextPage && (
          <Button size="xs" variant="default" loading={query.isFetchingNextPage} onClick={more}>
            Read more
          </Button>
        )}
      </Group>
    </Stack>
  );
}
