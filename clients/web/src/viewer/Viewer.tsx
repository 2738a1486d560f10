import { useMemo, useState } from "react";
import { SPEEDS, useClock } from "../scene/clock";
import { Film } from "../scene/Film";
import { loadsAt } from "../scene/loads";
import { boundsOf, readScene, type Machine } from "../scene/machine";
import { asPlaced, Parts } from "../scene/Parts";
import { startBounds } from "../scene/playing";
import { Stage } from "../scene/Stage";
import { Surroundings, type Scenario } from "../scene/Surroundings";
import type { Trial } from "../scene/trial";
import { framed } from "../scene/views";
import { trialOf, type Given } from "./given";

const CONTROLS = 84;
const HEADING = 42;

/** A machine or a trial in a notebook, in its own page without a server. */
export function Viewer({ given, height }: { given: Given; height: number }) {
  if (!given.heading) return <Shown given={given} height={height} />;
  return (
    <>
      <h1>{given.heading}</h1>
      <Shown given={given} height={height - HEADING} />
    </>
  );
}

function Shown({ given, height }: { given: Given; height: number }) {
  const machine = useMemo(() => readScene(given.machine), [given]);
  const trial = useMemo(() => (given.trial === null ? null : trialOf(given.trial)), [given]);
  if (trial === null) return <Standing machine={machine} title={given.title} height={height} />;
  return (
    <Played machine={machine} trial={trial} scenario={given.scenario} title={given.title} height={height - CONTROLS} />
  );
}

function Standing({ machine, title, height }: { machine: Machine; title: string; height: number }) {
  const bounds = useMemo(() => boundsOf(machine), [machine]);
  return (
    <Stage bounds={bounds} height={height} label={title}>
      <Surroundings scenario={null} floor={bounds.isEmpty() ? 0 : bounds.min.z} />
      <Parts machine={machine} pose={asPlaced} />
    </Stage>
  );
}

interface PlayedProps {
  machine: Machine;
  trial: Trial;
  scenario: Scenario | null;
  title: string;
  height: number;
}

function Played({ machine, trial, scenario, title, height }: PlayedProps) {
  const end = trial.times.at(-1) ?? 0;
  const clock = useClock(end);
  const [loads, setLoads] = useState(false);
  const bounds = useMemo(() => framed(startBounds(machine, trial), scenario), [machine, trial, scenario]);
  return (
    <>
      <Stage
        bounds={bounds}
        height={height}
        scenario={scenario}
        label={`${title}, at ${clock.shown.toFixed(1)} seconds`}
      >
        <Surroundings scenario={scenario} time={clock.shown} />
        <Film
          machine={machine}
          trial={trial}
          clock={clock}
          follow
          loads={loads ? loadsAt(trial, clock.shown) : null}
          terrain={scenario?.terrain}
        />
      </Stage>
      <div className="controls">
        <button type="button" onClick={clock.toggle}>
          {clock.playing ? "Pause" : "Play"}
        </button>
        <input
          type="range"
          aria-label="Time of the trial, seconds"
          min={0}
          max={end}
          step={0.04}
          value={clock.shown}
          onChange={(event) => clock.seek(Number(event.currentTarget.value))}
        />
        <output>
          {clock.shown.toFixed(1)} / {end.toFixed(0)} s
        </output>
      </div>
      <div className="controls">
        <label>
          Speed{" "}
          <select value={clock.speed} onChange={(event) => clock.setSpeed(event.currentTarget.value)}>
            {SPEEDS.map((speed) => (
              <option key={speed} value={speed}>
                {speed}×
              </option>
            ))}
          </select>
        </label>
        <label>
          <input type="checkbox" checked={loads} onChange={(event) => setLoads(event.currentTarget.checked)} /> Loads on
          joints
        </label>
      </div>
    </>
  );
}
