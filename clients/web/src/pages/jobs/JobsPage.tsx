import { Group, Stack, Title } from "@mantine/core";
import { getRouteApi, Link, useNavigate } from "@tanstack/react-router";
import type { JobsSearch } from "../../api/jobs-search";
import { isSite } from "../../api/site";
import { Filters } from "./Filters";
import { JobsList } from "./JobsList";
import { Said } from "./Said";

const route = getRouteApi("/jobs");

/** Jobs, filtered and sorted by what the address says. */
export default function JobsPage() {
  const search = route.useSearch();
  const navigate = useNavigate({ from: "/jobs" });
  const set = (change: Partial<JobsSearch>): void => {
    void navigate({ search: (before) => ({ ...before, ...change }), replace: true, resetScroll: false });
  };
  return (
    <Stack gap="md">
      <Group justify="space-between">
        <Title order={1}>Jobs</Title>
        <Link to="/sweeps">Sweeps</Link>
      </Group>
      <Filters search={search} set={set} />
      {!isSite && <Said />}
      <JobsList
        search={search}
        onSort={({ by, descending }) => set({ sort: by as JobsSearch["sort"], order: descending ? undefined : "asc" })}
      />
    </Stack>
  );
}
