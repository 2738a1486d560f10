import { Group, Text } from "@mantine/core";
import { loadColour } from "./loads";

const SHOWN = [0.6, 1];

/** What balls and colours in a trial mean. */
export function Legend({ whole }: { whole: boolean }) {
  return (
    <Group gap="sm" aria-label="What the marks mean" role="group">
      <Text size="xs">Load, share of the joint’s strength, from 50 % on{whole ? ", largest of the trial" : ""}:</Text>
      {SHOWN.map((share) => (
        <Group key={share} gap={4}>
          <svg width={18} height={18} aria-hidden>
            <circle cx={9} cy={9} r={3 + 6 * share} fill={loadColour(share)} stroke="currentColor" strokeWidth={0.5} />
          </svg>
          <Text size="xs">{100 * share} %</Text>
        </Group>
      ))}
      <Group gap={4}>
        <svg width={18} height={18} aria-hidden>
          <path d="M9 1 17 9 9 17 1 9ZM1 9H17M9 1V17" fill="none" stroke="#d6336c" strokeWidth={1.5} />
        </svg>
        <Text size="xs">broke here</Text>
      </Group>
    </Group>
  );
}
