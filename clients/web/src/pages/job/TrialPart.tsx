import { SegmentedControl, Stack } from "@mantine/core";
import { useQueries } from "@tanstack/react-query";
import { lazy, Suspense, useState } from "react";
import type { JobDetail } from "../../api/queries";
import { ProblemNote } from "../../parts/Problem";
import { Empty, Loading } from "../../parts/States";
import { scene as sceneQuery, trial as trialQuery } from "./queries";

const TrialView = lazy(() => import("../../scene/TrialView"));

/** The trial of one of a job's rollouts. */
export function TrialPart({
  job,
  numbers,
  begun = false,
}: {
  job: JobDetail;
  numbers: readonly number[];
  begun?: boolean;
}) {
  const [chosen, setChosen] = useState<number | null>(null);
  const number = chosen ?? numbers.at(-1) ?? 0;
  const [scene, trial] = useQueries({
    queries: [sceneQuery(job.id, number), trialQuery(job.id, number, job.artifacts[`trajectory-${number}`])],
  });
  const error = scene.error ?? trial.error;
  return (
    <Stack gap="xs">
      {numbers.length > 1 && (
        <SegmentedControl
          size="xs"
          aria-label="Rollout"
          value={String(number)}
          onChange={(value) => {
            setChosen(Number(value));
          }}
          data={numbers.map((one) => ({ value: String(one), label: `Rollout ${one}` }))}
        />
      )}
      {error !== null && (
        <ProblemNote
          error={error}
          retry={() => {
            void scene.refetch();
            void trial.refetch();
          }}
        />
      )}
      {error === null && (scene.data === undefined || trial.data === undefined) && <Loading rows={10} />}
      {scene.data !== undefined && trial.data !== undefined && (
        <Suspense fallback={<Loading rows={10} />}>
          {scene.data.machine === null ? (
            <Empty title="The trial had no machine" />
          ) : (
            <TrialView
              key={number}
              scene={scene.data.machine}
              trial={trial.data}
              scenario={scene.data.scenario}
              begun={begun}
            />
          )}
        </Suspense>
      )}
    </Stack>
  );
}
