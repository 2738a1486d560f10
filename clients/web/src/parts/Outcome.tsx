import { Badge } from "@mantine/core";
import {
  IconBan,
  IconCheck,
  IconClock,
  IconHourglass,
  IconLoader2,
  IconPlayerPause,
  IconPlugX,
  IconX,
  type Icon,
} from "@tabler/icons-react";
import { stateWords } from "../format";
import { OUTCOME_COLOURS } from "../theme";

const ICONS: Readonly<Record<string, Icon>> = {
  success: IconCheck,
  unsuccessful: IconX,
  construction_failed: IconX,
  limit: IconHourglass,
  excluded: IconBan,
  errored: IconPlugX,
  cancelled: IconBan,
  running: IconLoader2,
  queued: IconClock,
  on_hold: IconPlayerPause,
};

/** How a job ended, or its state: an icon, a word and a colour. */
export function OutcomeBadge({ value, size = "md" }: { value: string; size?: "sm" | "md" | "lg" }) {
  const Mark = ICONS[value] ?? IconClock;
  return (
    <Badge
      color={OUTCOME_COLOURS[value] ?? "gray"}
      variant="outline"
      size={size}
      tt="none"
      leftSection={<Mark size={13} aria-hidden />}
      styles={{ root: { color: "var(--mantine-color-text)" } }}
    >
      {stateWords(value)}
    </Badge>
  );
}
