import { Anchor, Group, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, useRouter } from "@tanstack/react-router";
import { job as jobQuery } from "../../api/queries";
import { number, stateWords } from "../../format";
import { Answered, Empty } from "../../parts/States";
import { rolloutsOf } from "./queries";
import { TrialPart } from "./TrialPart";

const route = getRouteApi("/embed/job/$id");

/** One trial in a frame of another page, with a line that says what it is and leads on. */
export default function EmbedPage() {
  const { id } = route.useParams();
  const search = route.useSearch();
  const router = useRouter();
  const query = useQuery(jobQuery(id));
  const { href } = router.buildLocation({ to: "/jobs/$id", params: { id }, search });
  return (
    <Answered query={query} rows={8}>
      {(job) => {
        const trials = rolloutsOf(job);
        return (
          <>
            <Group justify="space-between" gap="xs" mb="xs">
              <Text size="sm" component="h1" fw={600}>
                {job.task} by {job.model}: {stateWords(job.outcome ?? job.state)}
                {job.indicator !== null && `, ${number(job.indicator, 2)}`}
              </Text>
              <Anchor href={router.history.createHref(href)} target="_blank" rel="noreferrer" size="sm">
                The whole job
              </Anchor>
            </Group>
            {trials.length === 0 ? (
              <Empty title="This job has no trial" />
            ) : (
              <TrialPart job={job} numbers={trials} seen={search} />
            )}
          </>
        );
      }}
    </Answered>
  );
}
