import { Center, Stack, Text } from "@mantine/core";
import type { ReactNode } from "react";

/** Words in the place of what is not there. */
export function Empty({ title, children }: { title: string; children?: ReactNode }) {
  return (
    <Center py="xl">
      <Stack gap={6} align="center" maw={520}>
        <Text fw={600}>{title}</Text>
        <Text size="sm" ta="center" component="div" className="dimmed">
          {children}
        </Text>
      </Stack>
    </Center>
  );
}
