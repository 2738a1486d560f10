import { Alert, Anchor, Button, Group, List, Stack, Text } from "@mantine/core";
import { IconAlertTriangle } from "@tabler/icons-react";
import { Link } from "@tanstack/react-router";
import { NOT_KEPT } from "../api/site-cache";
import { ApiError, headline } from "../api/problem";
import { isSite } from "../api/site";
import { Empty } from "./Empty";
import { KeyField } from "./KeyField";

/** What a published site was not given to hold: no fault, and asking again finds it no more. */
function NotHere({ error }: { error: ApiError }) {
  return (
    <Empty title={headline(error)}>
      <p>{error.message}</p>
      <Anchor component={Link} to="/jobs" inherit>
        To the jobs
      </Anchor>
    </Empty>
  );
}

/** An error in words: what went wrong, in which field, what would be valid, what can be done. */
export function ProblemNote({ error, retry }: { error: unknown; retry?: () => void }) {
  if (error instanceof ApiError && NOT_KEPT.has(error.status) && isSite) return <NotHere error={error} />;
  const problem = error instanceof ApiError ? error.problem : null;
  const issues = problem?.errors ?? [];
  // The message already says a single fault, with its field and the choices.
  const listed = issues.length > 1 ? issues : [];
  const asksForKey = error instanceof ApiError && (error.status === 401 || error.status === 403);
  return (
    <Alert color="red" icon={<IconAlertTriangle aria-hidden />} title={headline(error)} role="alert">
      <Stack gap="xs">
        <Text size="sm">{error instanceof Error ? error.message : "unknown error"}</Text>
        {listed.length > 0 && (
          <List size="sm">
            {listed.map((issue) => (
              <List.Item key={`${issue.field} ${issue.message}`}>
                <code>{issue.field}</code>: {issue.message}
                {issue.choices.length > 0 && <> (choose from {issue.choices.join(", ")})</>}
              </List.Item>
            ))}
          </List>
        )}
        {asksForKey && <KeyField />}
        {error instanceof ApiError && error.status === 404 && (
          <Text size="sm">
            <Link to="/">The leaderboard</Link>, <Link to="/jobs">all jobs</Link>, <Link to="/tasks">all tasks</Link>
          </Text>
        )}
        {retry !== undefined && !asksForKey && (
          <Group>
            <Button size="xs" variant="default" onClick={retry}>
              Try again
            </Button>
          </Group>
        )}
      </Stack>
    </Alert>
  );
}
