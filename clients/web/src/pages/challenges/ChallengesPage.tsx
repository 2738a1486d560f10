import { Badge, Card, Group, SimpleGrid, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { Answered } from "../../parts/States";
import { seasons, type SeasonView } from "./queries";

/** All seasons of challenges. */
export default function ChallengesPage() {
  const query = useQuery(seasons());
  return (
    <Stack gap="lg">
      <div>
        <Title order={1}>Challenges</Title>
        <Text maw={720}>
          Contests for machines that models and people build. A package is checked here before it is handed in, and
          again when it is.
        </Text>
      </div>
      <Answered query={query}>
        {(listed) => (
          <SimpleGrid cols={{ base: 1, sm: 2 }}>
            {listed.map((view) => (
              <SeasonCard key={view.season.name} view={view} />
            ))}
          </SimpleGrid>
        )}
      </Answered>
    </Stack>
  );
}

function SeasonCard({ view: { season, is_open } }: { view: SeasonView }) {
  return (
    <Card withBorder padding="md">
      <Group justify="space-between" mb={4} wrap="nowrap">
        <Link className="quiet" to="/challenges/$name" params={{ name: season.name }}>
          <b>{season.title}</b>
        </Link>
        <Badge variant="light" color={is_open ? "teal" : "gray"} tt="none" styles={{ root: { color: "inherit" } }}>
          {is_open ? "open" : "closed"}
        </Badge>
      </Group>
      <Text size="sm">{season.about}</Text>
    </Card>
  );
}
