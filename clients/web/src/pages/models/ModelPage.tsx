import { Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link } from "@tanstack/react-router";
import { board, type Board } from "../../api/queries";
import { dollars, number, percent, places, words } from "../../format";
import { Section } from "../../parts/Section";
import { Answered, Empty } from "../../parts/States";
import { TaskTable } from "../../parts/TaskTable";

const route = getRouteApi("/models/$");

/** One model over tasks and dimensions. */
export default function ModelPage() {
  const { _splat: name = "" } = route.useParams();
  const query = useQuery(board({}));
  return (
    <Stack gap="lg">
      <Title order={1}>{name}</Title>
      <Answered query={query}>{(found) => <Profile board={found} name={name} />}</Answered>
    </Stack>
  );
}

function Profile({ board: found, name }: { board: Board; name: string }) {
  const overall = found.overall.find((row) => row.model === name);
  const tasks = found.tasks
    .map((task) => ({ ...task, rows: task.rows.filter((row) => row.model === name) }))
    .filter((task) => task.rows.length > 0);
  if (tasks.length === 0) {
    return (
      <Empty title="No job of this model has ended on the first track">
        <Link to="/jobs" search={{ model: name }}>
          Its jobs
        </Link>
      </Empty>
    );
  }
  return (
    <>
      {overall !== undefined && (
        <Group gap="xl">
          <Fact name="Place" value={places(overall.rank_low, overall.rank_high)} />
          <Fact name="Success, mean of tasks" value={percent(overall.success_rate_mean, 1)} />
          <Fact name="Dollars a job" value={dollars(overall.cost_usd_mean)} />
          {Object.entries(overall.dimensions).map(([dimension, score]) => (
            <Fact key={dimension} name={words(dimension)} value={number(score, 2)} />
          ))}
        </Group>
      )}
      {tasks.map((task) => (
        <Section key={task.task} title={task.task}>
          <TaskTable task={task} />
          <Text size="xs" className="dimmed">
            {Object.entries(task.rows[0]?.reasons ?? {}).map(([reason, n]) => `${n} ${words(reason)}`).join(", ")}
          </Text>
        </Section>
      ))}
    </>
  );
}

function Fact({ name, value }: { name: string; value: string }) {
  return (
    <div>
      <Text size="xs" className="dimmed">
        {name}
      </Text>
      <Text fw={650} size="lg" className="figures">
        {value}
      </Text>
    </div>
  );
}
