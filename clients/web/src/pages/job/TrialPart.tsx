import { SegmentedControl, Stack } from "@mantine/core";
import { useQueries } from "@tanstack/react-query";
import { lazy, Suspense, useState } from "react";
import type { JobSearch } from "../../api/jobs-search";
import type { JobDetail } from "../../api/queries";
import { ProblemNote } from "../../parts/Problem";
import { Empty, Loading } from "../../parts/States";
import { readLook, writtenLook, type Moment } from "../../scene/moment";
import { scene as sceneQuery, trial as trialQuery } from "./queries";

const TrialView = lazy(() => import("../../scene/TrialView"));

/** The trial of one of a job's rollouts. */
export function TrialPart({
  job,
  numbers,
  begun = false,
  seen,
  change,
}: {
  job: JobDetail;
  numbers: readonly number[];
  begun?: boolean;
  /** What the page's address says of it; without, it has none, and no moment of it can be sent. */
  seen?: JobSearch;
  change?: (to: JobSearch) => Promise<void>;
}) {
  const [own, setOwn] = useState<JobSearch>({});
  const search = seen ?? own;
  const asked = search.rollout !== undefined && numbers.includes(search.rollout) ? search.rollout : undefined;
  const number = asked ?? numbers.at(-1) ?? 0;
  const addressOf = async ({ time, look }: Moment): Promise<string> => {
    await change?.({ view: "trial", t: Number(time.toFixed(2)), rollout: number, camera: writtenLook(look) });
    return window.location.href;
  };
  const choose = (part: string | undefined): void => {
    if (change === undefined) setOwn((before) => ({ ...before, part }));
    else void change({ part });
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
            const to = { rollout: Number(value), t: undefined, camera: undefined };
            if (change === undefined) setOwn(to);
            else void change(to);
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
              part={search.part}
              onPart={choose}
              moment={{ time: search.t ?? 0, look: readLook(search.camera) }}
              addressOf={change === undefined ? undefined : addressOf}
            />
          )}
        </Suspense>
      )}
    </Stack>
  );
}
