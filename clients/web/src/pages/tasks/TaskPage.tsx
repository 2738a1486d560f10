import { Badge, Group, Stack, Text, Title } from "@mantine/core";
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
import { Machines } from "./Machines";

const ScenarioView = lazy(() => import("../../scene/ScenarioView"));
const route = getRouteApi("/tasks/$name");

/** A task: what must be built, how it is tried, and how models do. */
export default function TaskPage() {
  const { name } = route.useParams();
  const query = useQuery(taskQuery(name));
  return (
    <Answered query={query} rows={12}>
      {(task) => (
        <Stack gap="lg">
          <div>
            <Title order={1}>{task.title}</Title>
            <Group gap={6} mt={4}>
              <Badge variant="light" color="gray" tt="none">
                {task.category}, level {task.level}
              </Badge>
              {task.custom && (
                <Badge variant="outline" color="grape" tt="none" styles={{ root: { color: "inherit" } }}>
                  custom
                </Badge>
              )}
              <Text size="sm" className="dimmed">
                {task.name} · version {task.version} · ranked by {measured(task.indicator, task.unit)}
                {task.ceiling == null ? "" : `, at most ${number(task.ceiling)}`} ·{" "}
                <Link to="/jobs" search={{ task: task.name }}>
                  jobs
                </Link>
              </Text>
            </Group>
          </div>
          <Standings task={task} />
          <Group align="start" gap="lg" wrap="wrap">
            <div style={{ flex: "1 1 380px", minWidth: 0 }}>
              <Section title="Statement">
                <Markdown text={task.statement} />
              </Section>
            </div>
            <div style={{ flex: "1 1 380px", minWidth: 0 }}>
              <Section title="Scenario">
                <Suspense fallback={<Loading rows={8} />}>
                  <ScenarioView scenario={task.document.scenario as Scenario} />
                </Suspense>
              </Section>
            </div>
          </Group>
          <Machines task={task} />
        </Stack>
      )}
    </Answered>
  );
}

function Standings({ task }: { task: TaskDetail }) {
  const { track } = route.useSearch();
  const query = useQuery(board({ task: [task.name], track }));
  return (
    <Answered query={query}>
      {(found) => {
        const ranked = found.tasks.find((one) => one.task === task.name);
        return (
          <Section title="Models" aside={<Tracks known={found.tracks} chosen={found.track} />}>
            {ranked === undefined || ranked.rows.length === 0 ? (
              <Empty title="No job of this task has ended on this track" />
            ) : (
              <Stack gap="sm">
                <JobsSummary search={{ task: task.name, track: found.track ?? undefined, state: "done" }} />
                <TaskTable task={ranked} />
              </Stack>
            )}
          </Section>
        );
      }}
    </Answered>
  );
}

function Tracks({ known, chosen }: { known: readonly string[]; chosen: string | null }) {
  const navigate = useNavigate({ from: "/tasks/$name" });
  return (
    <TrackSelect
      known={known}
      chosen={chosen}
      onTrack={(track) => void navigate({ search: { track }, replace: true, resetScroll: false })}
    />
  );
}
