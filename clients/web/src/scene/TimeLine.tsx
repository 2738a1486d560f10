import { ActionIcon, Group, SegmentedControl, Slider, Text } from "@mantine/core";
import { IconPlayerPause, IconPlayerPlay, IconPlayerSkipBack } from "@tabler/icons-react";
import { SPEEDS, type Clock } from "./clock";
import type { Break } from "./trial";

/** Plays, stops and seeks; what broke is marked where it did. */
export function TimeLine({ clock, end, breaks }: { clock: Clock; end: number; breaks: readonly Break[] }) {
  return (
    <>
      <Group wrap="nowrap" gap="xs">
        <ActionIcon variant="default" size="lg" aria-label="From the start" onClick={() => clock.seek(0)}>
          <IconPlayerSkipBack size={18} aria-hidden />
        </ActionIcon>
        <ActionIcon size="lg" aria-label={clock.playing ? "Pause" : "Play"} onClick={clock.toggle}>
          {clock.playing ? <IconPlayerPause size={18} aria-hidden /> : <IconPlayerPlay size={18} aria-hidden />}
        </ActionIcon>
        <div style={{ flex: 1, position: "relative" }}>
          <Slider
            min={0}
            max={end}
            step={0.04}
            value={clock.shown}
            onChange={clock.seek}
            label={(value) => `${value.toFixed(2)} s`}
            thumbLabel="Time of the trial, seconds"
          />
          {breaks.slice(0, 200).map((found, index) => (
            <span
              key={index}
              className="break-mark"
              style={{ left: `${(100 * found.time_s) / Math.max(end, 1e-9)}%` }}
              aria-hidden
              title={`${found.joint} broke`}
            >
              ✕
            </span>
          ))}
        </div>
        <Text size="sm" className="figures" w={92} ta="right">
          {clock.shown.toFixed(1)} / {end.toFixed(0)} s
        </Text>
      </Group>
      <SegmentedControl
        style={{ alignSelf: "start" }}
        size="xs"
        aria-label="Speed"
        value={clock.speed}
        onChange={clock.setSpeed}
        data={SPEEDS.map((value) => ({ value, label: `${value}×` }))}
      />
    </>
  );
}
