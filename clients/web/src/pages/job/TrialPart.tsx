import { SegmentedControl, Stack } from "@mantine/core";
import { useQueries, useQuery } from "@tanstack/react-query";
import { lazy, Suspense, useState } from "react";
import type { JobSearch } from "../../api/jobs-search";
import { task as taskQuery, type JobDetail } from "../../api/queries";
import { counted } from "../../format";
import { ProblemNote } from "../../parts/Problem";
import { Empty, Loading } from "../../parts/States";
import { readLook, writtenLook, type Moment } from "../../scene/moment";
import { scene as sceneQuery, trial as trialQuery } from "./queries";
import { worldName } from "./worlds";

const TrialView = lazy(() => import("../../scene/TrialView"));

interface TrialPartProps {
  job: JobDetail;
  /** The trials there are: the first is the scored one. */
  numbers: readonly number[];
  /** What the page's address says of it; without, it has none, and no moment of it can be sent. */
  seen?: JobSearch;
  change?: (to: JobSearch) => Promise<void>;
}

/** Which world a trial is of, with its verdict where it counts. */
function labelOf(job: JobDetail, number: number): string {
  const world = job.worlds.find((one) => one.rollout === number);
  return world === undefined ? `Test trial ${number + 1}` : worldName(world, job.worlds);
}

/** The scored trial of a job, or one of those in varied worlds. */
export function TrialPart({ job, numbers, seen, change }: TrialPartProps) {
  const [own, setOwn] = useState<JobSearch>({});
  const search = seen ?? own;
  const asked = search.rollout !== undefined && numbers.includes(search.rollout) ? search.rollout : undefined;
  const number = asked ?? numbers[0] ?? 0;
  const set = (to: JobSearch): void => {
    if (change === undefined) setOwn((before) => ({ ...before, ...to }));
    else void change(to);
  };
  const addressOf = async ({ time, look }: Moment): Promise<string> => {
    await change?.({ t: Number(time.toFixed(2)), rollout: number, camera: writtenLook(look) });
    return window.location.href;
  };
  const [scene, trial] = useQueries({
    queries: [sceneQuery(job.id, number), trialQuery(job.id, number, job.artifacts[`trajectory-${number}`])],
  });
  const error = scene.error ?? trial.error;
  const title = useQuery(taskQuery(job.task, job.task_version)).data?.title ?? job.task;
  return (
    <Stack gap="xs">
      {numbers.length > 1 && (
        <SegmentedControl
          size="xs"
          style={{ alignSelf: "start" }}
          aria-label="Which trial"
          value={String(number)}
          onChange={(value) => set({ rollout: Number(value), t: undefined, camera: undefined })}
          data={numbers.map((one) => ({ value: String(one), label: labelOf(job, one) }))}
        />
      )}
      {error !== null ? (
        <ProblemNote
          error={error}
          retry={() => {
            void scene.refetch();
            void trial.refetch();
          }}
        />
      ) : scene.data === undefined || trial.data === undefined ? (
        <Loading rows={10} />
      ) : scene.data.machine === null ? (
        <Empty title="The trial had no machine" />
      ) : (
        <Suspense fallback={<Loading rows={10} />}>
          <TrialView
            key={number}
            scene={scene.data.machine}
            trial={trial.data}
            scenario={scene.data.scenario}
            part={search.part}
            onPart={(part) => set({ part })}
            moment={{ time: search.t ?? 0, look: readLook(search.camera) }}
            addressOf={change === undefined ? undefined : addressOf}
            caption={`${job.model} · ${title} · ${counted(scene.data.machine.blocks.length, "block")}`}
            verdict={job.worlds.find((one) => one.rollout === number)?.explanation ?? job.explanation}
            playing={seen !== undefined && asked === undefined && search.t === undefined}
          />
        </Suspense>
      )}
    </Stack>
  );
}
