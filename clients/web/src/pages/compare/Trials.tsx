import { Group, SimpleGrid, Stack, Switch, Text } from "@mantine/core";
import { useQueries } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useMemo, useState } from "react";
import type { JobDetail } from "../../api/queries";
import { number } from "../../format";
import { OutcomeBadge } from "../../parts/Outcome";
import { Empty, Loading } from "../../parts/States";
import { useClock } from "../../scene/clock";
import { Legend } from "../../scene/Legend";
import { CameraLock } from "../../scene/lock";
import { TimeLine } from "../../scene/TimeLine";
import type { Trial } from "../../scene/trial";
import { seenAlong } from "../../scene/flight";
import { TrialScene } from "../../scene/TrialView";
import { rolloutsOf, scene as sceneQuery, trial as trialQuery, type Scene } from "../job/queries";

type Jobs = readonly [JobDetail, JobDetail];

/** Two trials by one clock, seen by cameras that turn together. */
export default function Trials({ jobs }: { jobs: Jobs }) {
  const numbers = jobs.map((job) => rolloutsOf(job)[0] ?? 0);
  const scenes = useQueries({ queries: jobs.map((job, side) => sceneQuery(job.id, numbers[side] ?? 0)) });
  const trials = useQueries({
    queries: jobs.map((job, side) => {
      const number = numbers[side] ?? 0;
      return trialQuery(job.id, number, job.artifacts[`trajectory-${number}`]);
    }),
  });
  if ([...scenes, ...trials].some((query) => query.isError)) return <Empty title="A trial could not be read" />;
  const [firstScene, secondScene] = scenes.map((query) => query.data);
  const [first, second] = trials.map((query) => query.data);
  if (firstScene === undefined || secondScene === undefined || first === undefined || second === undefined)
    return <Loading rows={10} />;
  const seen = [seenAlong(first, firstScene.scenario), seenAlong(second, secondScene.scenario)] as const;
  return <InStep jobs={jobs} scenes={[firstScene, secondScene]} trials={seen} />;
}

interface Both {
  jobs: Jobs;
  scenes: readonly [Scene, Scene];
  trials: readonly [Trial, Trial];
}

function InStep({ jobs, scenes, trials }: Both) {
  const lock = useMemo(() => new CameraLock(), []);
  const end = Math.max(...trials.map((trial) => trial.times.at(-1) ?? 0));
  const clock = useClock(end);
  const [loads, setLoads] = useState(false);
  return (
    <Stack gap="xs">
      <SimpleGrid cols={{ base: 1, sm: 2 }}>
        {trials.map((trial, side) => {
          const { machine, scenario } = scenes[side] ?? scenes[0];
          const job = jobs[side] ?? jobs[0];
          return (
            <div key={side} data-trial={side === 0 ? "a" : "b"}>
              <Text size="sm" component="div" mb={4}>
                <Link to="/jobs/$id" params={{ id: job.id }}>
                  {job.task} by {job.model}, seed {job.seed}
                </Link>{" "}
                <OutcomeBadge value={job.outcome ?? job.state} size="sm" /> {number(job.indicator)}
              </Text>
              {machine === null ? (
                <Empty title="It had no machine" />
              ) : (
                <TrialScene
                  scene={machine}
                  scenario={scenario}
                  trial={trial}
                  clock={clock}
                  loads={loads}
                  follow={false}
                  height={320}
                  lock={lock}
                />
              )}
            </div>
          );
        })}
      </SimpleGrid>
      <TimeLine clock={clock} end={end} breaks={[...trials[0].breaks, ...trials[1].breaks]} />
      <Group>
        <Switch
          size="sm"
          label="Loads on joints"
          checked={loads}
          onChange={(event) => setLoads(event.currentTarget.checked)}
        />
        {loads && <Legend whole={trials.some((trial) => trial.loads === null)} />}
      </Group>
    </Stack>
  );
}
