import { SegmentedControl, Stack } from "@mantine/core";
import { useQueries } from "@tanstack/react-query";
import { getRouteApi, useNavigate } from "@tanstack/react-router";
import { lazy, Suspense } from "react";
import type { JobSearch } from "../../api/jobs-search";
import type { JobDetail } from "../../api/queries";
import { ProblemNote } from "../../parts/Problem";
import { Empty, Loading } from "../../parts/States";
import { readLook, writtenLook, type Moment } from "../../scene/moment";
import { scene as sceneQuery, trial as trialQuery } from "./queries";

const route = getRouteApi("/jobs/$id");
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
  const search = route.useSearch();
  const navigate = useNavigate({ from: "/jobs/$id" });
  const asked = search.rollout !== undefined && numbers.includes(search.rollout) ? search.rollout : undefined;
  const number = asked ?? numbers.at(-1) ?? 0;
  const change = (to: JobSearch): Promise<void> =>
    navigate({ search: (before) => ({ ...before, ...to }), replace: true, resetScroll: false });
  const addressOf = async ({ time, look }: Moment): Promise<string> => {
    await change({ view: "trial", t: Number(time.toFixed(2)), rollout: number, camera: writtenLook(look) });
    return window.location.href;
  };
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
            void change({ rollout: Number(value), t: undefined, camera: undefined });
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
              moment={
                asked === undefined && search.t === undefined
                  ? undefined
                  : { time: search.t ?? 0, look: readLook(search.camera) }
              }
              addressOf={addressOf}
            />
          )}
        </Suspense>
      )}
    </Stack>
  );
}
