import { Group, Stack, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { useMemo } from "react";
import { task as taskQuery, type JobDetail } from "../../api/queries";
import { number, words } from "../../format";
import { opposedWheels, opposedWords } from "../../scene/rolling";
import { rolloutsOf, scene as sceneQuery, trial as trialQuery } from "../job/queries";
import { TrialPart } from "../job/TrialPart";

/** The score of an ended job, what it was judged by, and its trial. */
export function Result({ job }: { job: JobDetail }) {
  const task = useQuery(taskQuery(job.task, job.task_version));
  const unit = task.data?.unit === "1" ? "" : (task.data?.unit ?? "");
  const figures = Object.entries(job.metrics ?? {}).filter(
    ([, value]) => typeof value === "number" || typeof value === "boolean",
  );
  const wanted =
    job.success === true ? null : missing(task.data?.document.scoring, task.data?.indicator, job.indicator);
  const trials = rolloutsOf(job.artifacts);
  return (
    <Stack gap="sm" data-outcome={job.outcome ?? ""}>
      <Text fz="xl" fw={700} className="figures">
        {job.success === true ? "✓ success" : "✗ no success"}
        {job.indicator !== null &&
          `: ${words(task.data?.indicator ?? "indicator")} ${job.censored ? "≥ " : ""}${number(job.indicator)} ${unit}`}
      </Text>
      {wanted !== null && (
        <Text size="sm">
          {number(job.indicator)} of {number(wanted)} {unit} that the task asks for.
        </Text>
      )}
      {job.success !== true && trials.length > 0 && <Wheels job={job} number={trials.at(-1) ?? 0} />}
      {job.reason !== null && (
        <Text size="sm">
          {words(job.reason)}
          {job.detail === null ? "" : `: ${job.detail}`}
        </Text>
      )}
      <Group gap="md">
        {figures.map(([name, value]) => (
          <Text key={name} size="sm" className="figures">
            <span className="dimmed">{words(name)}</span>{" "}
            {typeof value === "boolean" ? (value ? "yes" : "no") : number(value as number)}
          </Text>
        ))}
      </Group>
      {trials.length > 0 && <TrialPart job={job} numbers={trials} />}
    </Stack>
  );
}

/** Which wheels of a trial worked against each other, where some did. */
function Wheels({ job, number: rollout }: { job: JobDetail; number: number }) {
  const scene = useQuery(sceneQuery(job.id, rollout)).data?.machine;
  const trial = useQuery(trialQuery(job.id, rollout, job.artifacts[`trajectory-${rollout}`])).data;
  const opposed = useMemo(
    () => (scene == null || trial === undefined ? null : opposedWheels(trial, scene.blocks)),
    [scene, trial],
  );
  return opposed === null ? null : <Text size="sm">{opposedWords(opposed)}</Text>;
}

/** How much of what is measured a task asks for, where more was asked for than there is; null where it names none. */
export function missing(scoring: unknown, indicator: string | undefined, reached: number | null): number | null {
  const asked = (scoring as Record<string, unknown> | undefined)?.[`min_${indicator ?? ""}`];
  return typeof asked === "number" && reached !== null && reached < asked ? asked : null;
}
