import { Stack, Text } from "@mantine/core";
import { useQueries } from "@tanstack/react-query";
import { lazy, Suspense } from "react";
import { job as jobQuery } from "../../api/queries";
import { ProblemNote } from "../../parts/Problem";
import { Empty, Loading } from "../../parts/States";
import { rolloutsOf } from "../job/queries";

const Trials = lazy(() => import("./Trials"));

/** Two jobs: their last trials side by side. */
export function ComparedJobs({ ids }: { ids: readonly [string, string] }) {
  const [first, second] = useQueries({ queries: [jobQuery(ids[0]), jobQuery(ids[1])] });
  const error = first.error ?? second.error;
  if (error !== null)
    return (
      <ProblemNote
        error={error}
        retry={() => {
          void first.refetch();
          void second.refetch();
        }}
      />
    );
  if (first.data === undefined || second.data === undefined) return <Loading rows={10} />;
  const jobs = [first.data, second.data] as const;
  return (
    <Stack gap="xs">
      {jobs.some((job) => rolloutsOf(job).length === 0) ? (
        <Empty title="One of both had no trial">Only machines that were tried can be seen side by side.</Empty>
      ) : (
        <Suspense fallback={<Loading rows={10} />}>
          <Trials jobs={jobs} />
        </Suspense>
      )}
      {jobs[0].task !== jobs[1].task && (
        <Text size="sm">They are of different tasks, so their indicators say nothing about each other.</Text>
      )}
    </Stack>
  );
}
