import { Group, Stack } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { job as jobQuery } from "../../api/queries";
import { OutcomeBadge } from "../../parts/Outcome";
import { Answered } from "../../parts/States";
import { Result } from "./Result";

const ASK_EVERY_MS = 1_000;

/** A trial on no leaderboard, from when it was asked for: its score and its film. */
export function Tried({ id }: { id: string }) {
  const query = useQuery({
    ...jobQuery(id),
    refetchInterval: (asked) => (asked.state.data?.state === "done" ? false : ASK_EVERY_MS),
  });
  return (
    <Answered query={query} rows={6}>
      {(job) => (
        <Stack gap="sm">
          <Group gap="sm" role="status">
            <OutcomeBadge value={job.outcome ?? job.state} />
            <Link to="/jobs/$id" params={{ id }}>
              The whole job
            </Link>
          </Group>
          {job.state === "done" && <Result job={job} />}
        </Stack>
      )}
    </Answered>
  );
}
