import { Alert, Button, Code, Group, Stack, Switch, Text } from "@mantine/core";
import { useMemo, useRef, useState } from "react";
import { counted } from "../format";
import { useClock, type Clock } from "./clock";
import { Film } from "./Film";
import { seenAlong } from "./flight";
import { Legend } from "./Legend";
import { loadsAt, mostLoaded, mostOf } from "./loads";
import { CameraLock } from "./lock";
import { readScene, type MachineScene } from "./machine";
import type { Moment } from "./moment";
import { startBounds } from "./playing";
import { Share } from "./Share";
import { Stage } from "./Stage";
import { Surroundings, type Scenario } from "./Surroundings";
import { TimeLine } from "./TimeLine";
import type { Break, Trial } from "./trial";
import { breakCaption, framed } from "./views";

interface TrialProps {
  scene: MachineScene;
  trial: Trial;
  scenario: Scenario;
  /** When and from where it is seen at first. */
  moment?: Moment;
  /** The part that is pointed out. */
  part?: string;
  onPart?: (part: string | undefined) => void;
  /** What a picture of it says below the moment: whose machine it is, and on what. */
  caption?: string;
  /** How it ended, in a sentence. */
  verdict?: string | null;
  /** Whether it plays by itself, once. */
  playing?: boolean;
  /** The address of a moment; without, none can be copied. */
  addressOf?: (moment: Moment) => Promise<string>;
}

/** A trial, played: scrubbed, slowed, joints coloured by load, breaks marked. */
export default function TrialView({ trial: recorded, ...others }: TrialProps) {
  const props = { ...others, trial: seenAlong(recorded, others.scenario) };
  const end = props.trial.times.at(-1) ?? 0;
  const { moment, addressOf } = props;
  const clock = useClock(end, moment?.time, props.playing);
  const [lock] = useState(() => new CameraLock(moment?.look));
  const stage = useRef<HTMLDivElement>(null);
  const [loads, setLoads] = useState(false);
  const [follow, setFollow] = useState(true);
  return (
    <Stack gap="xs">
      <div ref={stage}>
        <TrialScene {...props} clock={clock} loads={loads} follow={follow} lock={lock} />
      </div>
      <TimeLine clock={clock} end={end} breaks={props.trial.breaks} />
      <Group gap="md">
        <Switch
          size="sm"
          label="Loads on joints"
          checked={loads}
          onChange={(event) => setLoads(event.currentTarget.checked)}
        />
        <Switch
          size="sm"
          label="Follow the machine"
          checked={follow}
          onChange={(event) => setFollow(event.currentTarget.checked)}
        />
        <Text size="xs" className="dimmed">
          {props.trial.engine} {props.trial.engineVersion}
        </Text>
      </Group>
      <Share
        stage={stage}
        clock={clock}
        caption={[breakCaption(props.trial, clock.shown) ?? props.verdict, props.caption].filter(
          (line) => line != null,
        )}
        address={addressOf === undefined ? undefined : () => addressOf({ time: clock.time.current, look: lock.look })}
      />
      {props.part !== undefined && (
        <Chosen trial={props.trial} machine={props.scene} part={props.part} clear={() => props.onPart?.(undefined)} />
      )}
      {loads && <Legend whole={props.trial.loads === null} />}
      <Broken breaks={props.trial.breaks} seek={clock.seek} />
      {props.scene.controller !== "" && (
        <details>
          <Text component="summary" size="sm">
            Program
          </Text>
          <Code block style={{ maxHeight: 400, overflow: "auto" }}>
            {props.scene.controller}
          </Code>
        </details>
      )}
    </Stack>
  );
}

/** The drawing of a trial at the clock's time. */
export function TrialScene({
  scene,
  trial,
  scenario,
  clock,
  loads,
  follow,
  height,
  lock,
  moment,
  part,
  onPart,
}: TrialProps & { clock: Clock; loads: boolean; follow: boolean; height?: number; lock?: CameraLock }) {
  const machine = useMemo(() => readScene(scene), [scene]);
  const bounds = useMemo(() => framed(startBounds(machine, trial), scenario), [machine, trial, scenario]);
  const jointLoads = loadsAt(trial, clock.shown);
  const most = mostLoaded(trial, jointLoads);
  return (
    <>
      <Stage
        bounds={bounds}
        height={height}
        label={`The trial at ${clock.shown.toFixed(1)} seconds`}
        lock={lock}
        scenario={scenario}
        caption={breakCaption(trial, clock.shown)}
      >
        <Surroundings scenario={scenario} time={clock.shown} />
        <Film
          machine={machine}
          trial={trial}
          clock={clock}
          follow={follow}
          loads={loads && most !== null ? jointLoads : null}
          begins={moment?.look ? moment.time : 0}
          terrain={scenario.terrain}
          chosen={part}
          onChoose={onPart}
        />
      </Stage>
      {loads && most !== null && (
        <Text size="xs" className="figures">
          {most.joint} carries {(100 * most.ratio).toFixed(0)} % of its strength{most.ratio > 1 ? ": overloaded" : ""}.
        </Text>
      )}
    </>
  );
}

/** The clicked part, and the highest load on its joints in the whole trial. */
function Chosen({
  trial,
  machine,
  part,
  clear,
}: {
  trial: Trial;
  machine: MachineScene;
  part: string;
  clear: () => void;
}) {
  const [block, rod] = [machine.blocks, machine.connectors].map((all) => all.find(({ id }) => id === part));
  const module = (block ?? rod)?.module;
  const most = mostOf(trial, part, machine.connectors.find(({ id }) => id === part)?.joint);
  if (module === undefined) return null;
  return (
    <Group gap="xs">
      <Text size="sm" className="figures">
        Part {part}, {module}: its joints carry up to {(100 * most).toFixed(0)} % of their strength.
      </Text>
      <Button size="compact-xs" variant="default" onClick={clear}>
        Let it go
      </Button>
    </Group>
  );
}

const NAMED = 8;

function Broken({ breaks, seek }: { breaks: readonly Break[]; seek: (time: number) => void }) {
  if (breaks.length === 0) return null;
  return (
    <Alert color="red" py="xs" title={`${counted(breaks.length, "joint")} broke`}>
      <Group gap={6}>
        {breaks.slice(0, NAMED).map((found, index) => (
          <Button key={index} size="compact-xs" variant="default" onClick={() => seek(Math.max(0, found.time_s - 0.2))}>
            ✕ {found.kind} {found.joint} at {found.time_s.toFixed(2)} s, {(100 * found.ratio).toFixed(0)} %
          </Button>
        ))}
        {breaks.length > NAMED && <Text size="sm">and {breaks.length - NAMED} more</Text>}
      </Group>
    </Alert>
  );
}
