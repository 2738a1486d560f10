import { Text } from "@mantine/core";
import type { ReactNode } from "react";

/** A figure under its name, and what belongs to it. */
export function Fact({ name, value, children }: { name: string; value: string; children?: ReactNode }) {
  return (
    <div>
      <Text size="xs" className="dimmed">
        {name}
      </Text>
      <Text fw={650} size="lg" className="figures">
        {value}
      </Text>
      {children}
    </div>
  );
}
