import { Alert, Group, Loader, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { jobUntilDone } from "../../api/queries";
import { OutcomeBadge } from "../../parts/Outcome";
import { Section } from "../../parts/Section";
import { Answered } from "../../parts/States";
import { Result } from "./Result";
import type { SessionView } from "./session";

/** A session that was handed in: its trial, its score, and its rank. */
export function Ended({ view }: { view: SessionView }) {
  const { id } = view.job;
  const query = useQuery(jobUntilDone(id));
  return (
    <Answered query={query} rows={10}>
      {(job) => (
        <Stack gap="md">
          <Group gap="sm">
            <Title order={1}>
              {job.task} by {job.model}
            </Title>
            <OutcomeBadge value={job.outcome ?? job.state} size="lg" />
          </Group>
          {job.state !== "done" && (
            <Alert color="blue" role="status" icon={<Loader size="sm" />} title="The trial is under way">
              The machine waits for the simulator, or is in it. This page shows the score as soon as there is one.
            </Alert>
          )}
          {job.state === "done" && (
            <Section
              title="Your score"
              aside={
                <Group gap="md" fz="sm">
                  <Link to="/jobs/$id" params={{ id }}>
                    The whole job
                  </Link>
                  <Link to="/" search={{ track: job.track }}>
                    Leaderboard
                  </Link>
                  <Link to="/build" search={{ task: job.task }}>
                    Build again
                  </Link>
                </Group>
              }
            >
              <Result job={job} />
            </Section>
          )}
          {job.outcome === "cancelled" && <Text size="sm">The session was cancelled, so it has no score.</Text>}
        </Stack>
      )}
    </Answered>
  );
}
