import { SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link, useNavigate } from "@tanstack/react-router";
import { lazy, Suspense } from "react";
import { board, task as taskQuery, type TaskDetail } from "../../api/queries";
import { measured, number } from "../../format";
import { JobsSummary } from "../../parts/JobsSummary";
import { Markdown } from "../../parts/Markdown";
import { Section } from "../../parts/Section";
import { Answered, Empty, Loading } from "../../parts/States";
import { TaskTable } from "../../parts/TaskTable";
import { TrackSelect } from "../../parts/TrackSelect";
import type { Scenario } from "../../scene/Surroundings";
import { entriesOf, keyOf } from "../board/entries";
import { goalOf } from "./goal";
import { Machines } from "./Machines";

const ScenarioView = lazy(() => import("../../scene/ScenarioView"));
const route = getRouteApi("/tasks/$name");

/** A task: its goal and its course, the best machines, how models do. */
export default function TaskPage() {
  const { name } = route.useParams();
  const query = useQuery(taskQuery(name));
  return (
    <Answered query={query} rows={12}>
      {(task) => (
        <Stack gap="lg">
          <div>
            <Title order={1}>{task.title}</Title>
            <Text>{goalOf(task.statement)}</Text>
            <Text size="sm" className="dimmed">
              {task.category_title}, level {task.level}
              {task.custom && ", custom"} · {task.name} · version {task.version} · ranked by{" "}
              {measured(task.indicator, task.unit)}
              {task.ceiling == null ? "" : `, at most ${number(task.ceiling)}`} ·{" "}
              <Link to="/jobs" search={{ task: task.name }}>
                jobs
              </Link>
            </Text>
          </div>
          <Machines task={task} outcome="success" />
          <SimpleGrid cols={{ base: 1, md: 2 }} spacing="lg">
            <Section title="Course">
              <Suspense fallback={<Loading rows={8} />}>
                <ScenarioView scenario={task.document.scenario as Scenario} />
              </Suspense>
            </Section>
            <Section title="Statement">
              <Markdown text={task.statement} />
            </Section>
          </SimpleGrid>
          <Standings task={task} />
          <Machines task={task} outcome="unsuccessful" />
        </Stack>
      )}
    </Answered>
  );
}

function Standings({ task }: { task: TaskDetail }) {
  const { track } = route.useSearch();
  const navigate = useNavigate({ from: "/tasks/$name" });
  const query = useQuery(board({ task: [task.name], track }));
  return (
    <Answered query={query}>
      {(found) => {
        const ranked = found.tasks.find((one) => one.task === task.name);
        const labels = new Map(entriesOf(found, true).map(({ key, label }) => [key, label]));
        return (
          <Section
            title="Models"
            aside={
              <TrackSelect
                known={found.tracks}
                chosen={found.track}
                onTrack={(to) => void navigate({ search: { track: to }, replace: true, resetScroll: false })}
              />
            }
          >
            {ranked === undefined || ranked.rows.length === 0 ? (
              <Empty title="No run of this task has ended on this track" />
            ) : (
              <Stack gap="sm">
                <JobsSummary search={{ task: task.name, track: found.track ?? undefined, state: "done" }} />
                <TaskTable
                  name={`Models on ${task.name}`}
                  of="Model"
                  shown={ranked.rows.map((row) => ({
                    row,
                    label: labels.get(keyOf(row)) ?? row.model,
                    measure: measured(ranked.indicator, ranked.unit),
                  }))}
                />
              </Stack>
            )}
          </Section>
        );
      }}
    </Answered>
  );
}
