import { Text } from "@mantine/core";
import * as Plot from "@observablehq/plot";
import { useQuery } from "@tanstack/react-query";
import { client, taken } from "../../api/client";
import type { JobView, TaskDetail } from "../../api/queries";
import { measured, number, words } from "../../format";
import Drawing from "../../parts/Plot";
import { Section } from "../../parts/Section";
import { Answered, Empty } from "../../parts/States";

const MOST = 1000;

/** Indicators of a task's ended jobs, a dot for each, by model. */
export default function Distribution({ task, track }: { task: TaskDetail; track: string }) {
  const query = useQuery({
    queryKey: ["indicators", task.name, task.version, track],
    queryFn: () =>
      taken(
        client.GET("/v1/jobs", {
          params: {
            query: { task: task.name, task_version: task.version, track, state: "done", sort: "finished", limit: MOST },
          },
        }),
      ),
  });
  return (
    <Section title={`Distribution of ${words(task.indicator)}`}>
      <Answered query={query} rows={5}>
        {(page) => (
          <Drawn
            jobs={page.jobs.filter((job) => job.indicator !== null)}
            task={task}
            more={page.next_cursor !== null}
          />
        )}
      </Answered>
    </Section>
  );
}

function Drawn({ jobs, task, more }: { jobs: readonly JobView[]; task: TaskDetail; more: boolean }) {
  if (jobs.length === 0) return <Empty title="No job of this task was scored" />;
  const models = [...new Set(jobs.map((job) => job.model))].sort();
  const options = (width: number): Plot.PlotOptions => ({
    height: 70 + 44 * models.length,
    marginLeft: Math.min(150, 0.32 * width),
    marginBottom: 42,
    style: { fontSize: "12px" },
    x: { label: `${measured(task.indicator, task.unit)} →`, grid: true, zero: true, type: "sqrt" },
    y: { label: null, domain: models },
    color: { domain: ["success", "failure"], range: ["#009e73", "#d55e00"], legend: true },
    symbol: { domain: ["success", "failure"], range: ["circle", "times"], legend: false },
    marks: [
      Plot.tickX(
        jobs,
        Plot.groupY({ x: "median" }, { y: "model", x: "indicator", strokeWidth: 2, strokeOpacity: 0.5 }),
      ),
      Plot.dot(jobs, {
        x: "indicator",
        y: "model",
        r: 4,
        strokeWidth: 1.6,
        stroke: (job: JobView) => (job.success === true ? "success" : "failure"),
        symbol: (job: JobView) => (job.success === true ? "success" : "failure"),
        tip: true,
        title: (job: JobView) =>
          `${job.model}, seed ${job.seed}: ${number(job.indicator)} ${task.unit === "1" ? "" : task.unit}`,
      }),
    ],
  });
  const range = (model: string): string => {
    const values = jobs.filter((job) => job.model === model).map((job) => job.indicator ?? 0);
    return `${model}: ${values.length} jobs from ${number(Math.min(...values))} to ${number(Math.max(...values))}`;
  };
  return (
    <>
      <Drawing options={options} label={models.map(range).join("; ")} />
      <Text size="xs" className="dimmed">
        Each mark is a job: a circle succeeded, a cross failed; the line is the median. The scale is that of square
        roots. As scored, whatever the flags say
        {more ? `; the ${MOST.toLocaleString("en")} that ended last` : ""}.
      </Text>
    </>
  );
}
