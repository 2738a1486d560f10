import { Group, Stack } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { jobUntilDone } from "../../api/queries";
import { OutcomeBadge } from "../../parts/Outcome";
import { Answered } from "../../parts/States";
import { Result } from "./Result";

/** A trial on no leaderboard, from when it was asked for: its score and its film. */
export function Tried({ id }: { id: string }) {
  const query = useQuery(jobUntilDone(id));
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
