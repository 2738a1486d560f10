import { ActionIcon, Alert, Group, SegmentedControl, Slider, Stack, Switch, Text } from "@mantine/core";
import { IconPlayerPause, IconPlayerPlay, IconPlayerSkipBack } from "@tabler/icons-react";
import { useCallback, useEffect, useMemo, useRef, useState } from "react";
import { Box3, Matrix4, Vector3 } from "three";
import { duration } from "../format";
import { Curves } from "./Curves";
import { boundsOf, readMachine, type MachineDocument, type Part } from "./machine";
import { cargoAt, poseAt } from "./playing";
import { Stage } from "./Stage";
import { Surroundings, type Scenario } from "./Surroundings";
import { curvesOf, type Trial } from "./trial";
import { Film } from "./Film";

const SPEEDS = ["0.25", "1", "4"];
const TELL_EVERY_MS = 80;

/** A trial, played: scrubbed, slowed, with what broke marked on the time line. */
export default function TrialView({ document, trial, scenario }: { document: MachineDocument; trial: Trial; scenario: Scenario | null }) {
  const machine = useMemo(() => readMachine(document), [document]);
  const end = trial.times.at(-1) ?? 0;
  const [loads, setLoads] = useState(false);
  const [follow, setFollow] = useState(true);
  const clock = useClock(end);
  const bounds = useMemo(() => {
    const start = poseAt(trial, 0);
    const whole = boundsOf({ ...machine, parts: machine.parts.map((part) => ({ ...part, pose: start(part, part.pose.clone()) })) });
    if (trial.cargo !== null) {
      const size = new Vector3(...trial.cargo.size);
      whole.union(new Box3().setFromCenterAndSize(new Vector3().setFromMatrixPosition(cargoAt(trial, 0, new Matrix4())), size));
    }
    return whole;
  }, [machine, trial]);
  const curves = useMemo(() => curvesOf(trial), [trial]);
  const worst = useMemo(() => worstLoads(trial), [trial]);
  const colour = useCallback((part: Part) => (loads ? loadColour(worst.get(part.id) ?? 0) : null), [loads, worst]);
  return (
    <Stack gap="xs">
      <Stage bounds={bounds} height={420} label={`The trial at ${clock.shown.toFixed(1)} seconds`}>
        <Surroundings scenario={scenario} />
        <Film machine={machine} trial={trial} time={clock.time} playing={clock.playing} follow={follow} colour={colour} shown={clock.shown} />
      </Stage>
      <Group wrap="nowrap" gap="xs">
        <ActionIcon variant="default" size="lg" aria-label="From the start" onClick={() => { clock.seek(0); }}>
          <IconPlayerSkipBack size={18} aria-hidden />
        </ActionIcon>
        <ActionIcon size="lg" aria-label={clock.playing ? "Pause" : "Play"} onClick={clock.toggle}>
          {clock.playing ? <IconPlayerPause size={18} aria-hidden /> : <IconPlayerPlay size={18} aria-hidden />}
        </ActionIcon>
        <Slider
          style={{ flex: 1 }}
          min={0}
          max={end}
          step={0.04}
          value={clock.shown}
          onChange={clock.seek}
          label={(value) => `${value.toFixed(2)} s`}
          thumbLabel="Time of the trial, seconds"
          marks={trial.breaks.map((found) => ({ value: found.time_s }))}
        />
        <Text size="sm" className="figures" w={92} ta="right">
          {clock.shown.toFixed(1)} / {end.toFixed(0)} s
        </Text>
      </Group>
      <Group gap="md">
        <SegmentedControl size="xs" aria-label="Speed" value={clock.speed} onChange={clock.setSpeed} data={SPEEDS.map((value) => ({ value, label: `${value}×` }))} />
        <Switch size="sm" label="Follow the machine" checked={follow} onChange={(event) => { setFollow(event.currentTarget.checked); }} />
        <Switch size="sm" label="Colour by the largest load" checked={loads} onChange={(event) => { setLoads(event.currentTarget.checked); }} />
        <Text size="xs" className="dimmed">
          {trial.engine} {trial.engineVersion}
        </Text>
      </Group>
      {trial.breaks.length > 0 && (
        <Alert color="red" py="xs" title={`${trial.breaks.length} joint${trial.breaks.length > 1 ? "s" : ""} broke`}>
          <Text size="sm">
            {trial.breaks.slice(0, 6).map((found) => `${found.kind} ${found.joint} at ${duration(found.time_s)}, at ${(100 * found.ratio).toFixed(0)} % of its strength`).join("; ")}
            {trial.breaks.length > 6 ? "; …" : ""}
          </Text>
        </Alert>
      )}
      <Curves curves={curves} times={trial.times} now={clock.shown} breaks={trial.breaks.map((found) => found.time_s)} seek={clock.seek} />
    </Stack>
  );
}

/** The largest share of its strength that a joint at each block bore. */
export function worstLoads(trial: Trial): Map<string, number> {
  const known = new Set(trial.blockIds);
  const worst = new Map<string, number>();
  for (const peak of trial.peaks) {
    for (const id of peak.joint.split("-").filter((part) => known.has(part))) {
      worst.set(id, Math.max(worst.get(id) ?? 0, peak.ratio));
    }
  }
  return worst;
}

/** From grey for no load to red for one that breaks. */
export function loadColour(ratio: number): string {
  const share = Math.min(1, Math.max(0, ratio));
  return `hsl(${Math.round(210 - 205 * share)} ${Math.round(20 + 65 * share)}% ${Math.round(62 - 12 * share)}%)`;
}

function useClock(end: number) {
  const time = useRef(0);
  const [shown, setShown] = useState(0);
  const [playing, setPlaying] = useState(false);
  const [speed, setSpeed] = useState("1");
  useEffect(() => {
    if (!playing) return;
    let frame = 0;
    let before = performance.now();
    let told = before;
    const step = (now: number): void => {
      time.current = Math.min(end, time.current + ((now - before) / 1000) * Number(speed));
      before = now;
      if (now - told > TELL_EVERY_MS || time.current >= end) {
        told = now;
        setShown(time.current);
      }
      if (time.current >= end) setPlaying(false);
      else frame = requestAnimationFrame(step);
    };
    frame = requestAnimationFrame(step);
    return () => {
      cancelAnimationFrame(frame);
    };
  }, [playing, speed, end]);
  const seek = (to: number): void => {
    time.current = to;
    setShown(to);
  };
  const toggle = (): void => {
    if (!playing && time.current >= end) seek(0);
    setPlaying(!playing);
  };
  return { time, shown, playing, speed, setSpeed, seek, toggle };
}
