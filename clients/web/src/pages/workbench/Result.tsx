import { Group, Stack, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { task as taskQuery, type JobDetail } from "../../api/queries";
import { number, words } from "../../format";
import { rolloutsOf } from "../job/queries";
import { TrialPart } from "../job/TrialPart";

/** The score of an ended job, what it was judged by, and its trial. */
export function Result({ job }: { job: JobDetail }) {
  const task = useQuery(taskQuery(job.task, job.task_version));
  const unit = task.data?.unit === "1" ? "" : (task.data?.unit ?? "");
  const figures = Object.entries(job.metrics).filter(
    ([, value]) => typeof value === "number" || typeof value === "boolean",
  );
  const trials = rolloutsOf(job);
  return (
    <Stack gap="sm" data-outcome={job.outcome ?? ""}>
      <Text fz="xl" fw={700} className="figures">
        {job.outcome === "success" ? "✓ success" : "✗ no success"}
        {job.indicator !== null &&
          `: ${words(task.data?.indicator ?? "indicator")} ${job.censored ? "≥ " : ""}${number(job.indicator)} ${unit}`}
      </Text>
      <Text size="sm">{job.explanation}</Text>
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
