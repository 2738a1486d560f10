import { Badge, Card, Group, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { tasks, type Task } from "../../api/queries";
import { measured } from "../../format";
import { Answered } from "../../parts/States";
import { goalOf } from "./goal";

/** All tasks, by category. */
export default function TasksPage() {
  const query = useQuery(tasks());
  return (
    <Stack gap="lg">
      <Title order={1}>Tasks</Title>
      <Answered query={query}>
        {(found) =>
          [...new Set(found.map((task) => task.category_title))].map((category) => (
            <section key={category} aria-label={category}>
              <Title order={2} mb="sm">
                {category}
              </Title>
              <SimpleGrid cols={{ base: 1, sm: 2, md: 3 }}>
                {found
                  .filter((task) => task.category_title === category)
                  .map((task) => (
                    <TaskCard key={task.name} task={task} />
                  ))}
              </SimpleGrid>
            </section>
          ))
        }
      </Answered>
    </Stack>
  );
}

function TaskCard({ task }: { task: Task }) {
  return (
    <Card withBorder padding="md">
      <Group justify="space-between" mb={4} wrap="nowrap">
        <Link className="quiet" to="/tasks/$name" params={{ name: task.name }}>
          <b>{task.title}</b>
        </Link>
        <Group gap={4} wrap="nowrap" style={{ flexShrink: 0 }}>
          {task.custom && (
            <Badge size="sm" variant="outline" color="grape" tt="none">
              custom
            </Badge>
          )}
          <Badge size="sm" variant="light" color="gray" tt="none">
            level {task.level}
          </Badge>
        </Group>
      </Group>
      <Text size="xs" ff="monospace" className="dimmed">
        {task.name} · {task.version}
      </Text>
      <Text size="sm" mt="xs" lineClamp={4}>
        {goalOf(task.statement)}
      </Text>
      <Text size="xs" mt="xs" className="dimmed">
        ranked by {measured(task.indicator, task.unit)}
      </Text>
    </Card>
  );
}
