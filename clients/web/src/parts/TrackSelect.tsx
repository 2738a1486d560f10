import { Select } from "@mantine/core";
import { trackLabel } from "../format";

/** Which track's results are shown; empty without a choice. */
export function TrackSelect({
  known,
  chosen,
  onTrack,
}: {
  known: readonly string[];
  chosen: string | null;
  onTrack: (track: string) => void;
}) {
  if (known.length < 2) return null;
  return (
    <Select
      aria-label="Track"
      size="xs"
      data={known.map((track) => ({ value: track, label: trackLabel(track) }))}
      value={chosen}
      allowDeselect={false}
      w={{ base: "100%", sm: 320 }}
      onChange={(track) => {
        if (track !== null) onTrack(track);
      }}
    />
  );
}
