import { Stack } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi } from "@tanstack/react-router";
import { Answered } from "../../parts/States";
import { Ended } from "./Ended";
import { session as sessionQuery } from "./session";
import { StartForm } from "./StartForm";
import { isTested, TestTrials } from "./TestTrials";
import { Workroom } from "./Workroom";

const route = getRouteApi("/build");

/** A person builds a machine by hand, with the tools and the feedback that models get. */
export default function BuildPage() {
  const { session } = route.useSearch();
  return session === undefined ? <StartForm /> : <Session key={session} id={session} />;
}

function Session({ id }: { id: string }) {
  const query = useQuery({
    ...sessionQuery(id),
    staleTime: Infinity,
    refetchInterval: ({ state }) => (state.data !== undefined && isTested(state.data) ? 1000 : false),
  });
  return (
    <Stack gap="md">
      <Answered query={query} rows={12}>
        {(view) => {
          if (view.open) return <Workroom view={view} />;
          return isTested(view) ? <TestTrials view={view} /> : <Ended view={view} />;
        }}
      </Answered>
    </Stack>
  );
}
