import { Alert, Button, Group, List, Stack, Text } from "@mantine/core";
import { IconAlertTriangle } from "@tabler/icons-react";
import { ApiError, headline } from "../api/problem";
import { KeyField } from "./KeyField";

/** An error in words: what went wrong, in which field, what would be valid, what can be done. */
export function ProblemNote({ error, retry }: { error: unknown; retry?: () => void }) {
  const problem = error instanceof ApiError ? error.problem : null;
  const issues = problem?.errors ?? [];
  const asksForKey = error instanceof ApiError && (error.status === 401 || error.status === 403);
  return (
    <Alert color="red" icon={<IconAlertTriangle aria-hidden />} title={headline(error)} role="alert">
      <Stack gap="xs">
        <Text size="sm">{error instanceof Error ? error.message : "unknown error"}</Text>
        {issues.length > 0 && (
          <List size="sm">
            {issues.map((issue) => (
              <List.Item key={`${issue.field} ${issue.message}`}>
                <code>{issue.field}</code>: {issue.message}
                {issue.choices.length > 0 && <> (choose from {issue.choices.join(", ")})</>}
              </List.Item>
            ))}
          </List>
        )}
        {asksForKey && <KeyField />}
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
