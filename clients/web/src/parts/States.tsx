import { Badge, Group, Skeleton, Stack } from "@mantine/core";
import { IconCloudOff } from "@tabler/icons-react";
import type { UseQueryResult } from "@tanstack/react-query";
import { useDeferredValue, type ReactNode } from "react";
import { ProblemNote } from "./Problem";
import { RelativeTime } from "./RelativeTime";

export { Empty } from "./Empty";

/** Grey bars in the place of what is being read. */
export function Loading({ rows = 6 }: { rows?: number }) {
  return (
    <Stack gap="xs" aria-busy="true" aria-label="Loading" role="status">
      {Array.from({ length: rows }, (_, index) => (
        <Skeleton key={index} height={22} width={`${100 - ((index * 17) % 40)}%`} />
      ))}
    </Stack>
  );
}

/** A note that what is shown is older than it should be. */
export function Stale({ since }: { since: number }) {
  return (
    <Badge
      color="yellow"
      variant="outline"
      styles={{ root: { color: "inherit" } }}
      leftSection={<IconCloudOff size={14} aria-hidden />}
      tt="none"
      role="status"
    >
      not refreshed since <RelativeTime time={new Date(since).toISOString()} />
    </Badge>
  );
}

/** What a query has found, or the state it is in. Data that was read once stays, marked as old. */
export function Answered<Data>({
  query,
  children,
  rows,
}: {
  query: UseQueryResult<Data>;
  children: (data: Data) => ReactNode;
  rows?: number;
}) {
  // What was read is drawn piece by piece: the browser answers in between.
  const data = useDeferredValue(query.data);
  if (data !== undefined) {
    return (
      <>
        {query.isError && (
          <Group mb="xs">
            <Stale since={query.dataUpdatedAt} />
          </Group>
        )}
        {children(data)}
      </>
    );
  }
  if (query.isError) return <ProblemNote error={query.error} retry={() => void query.refetch()} />;
  return <Loading rows={rows} />;
}
