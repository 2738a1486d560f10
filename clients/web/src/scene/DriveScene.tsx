import { useEffect, useMemo, useRef, useState } from "react";
import { TICK_MS, type Live } from "./live";
import type { Clock } from "./clock";
import { Film } from "./Film";
import { readScene, type MachineScene } from "./machine";
import { startBounds } from "./playing";
import { Stage } from "./Stage";
import { Surroundings, type Scenario } from "./Surroundings";

const TELL_EVERY_MS = 200;
const nothing = (): void => undefined;

interface DriveSceneProps {
  scene: MachineScene;
  scenario: Scenario;
  live: Live;
  playing: boolean;
}

/** A machine that is driven now: from where it was a tick ago to where it is. */
export default function DriveScene({ scene, scenario, live, playing }: DriveSceneProps) {
  const machine = useMemo(() => readScene(scene), [scene]);
  const bounds = useMemo(() => startBounds(machine, live.trial), [machine, live]);
  const time = useRef(0);
  const [seconds, setSeconds] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => {
      setSeconds(live.time);
    }, TELL_EVERY_MS);
    return () => {
      clearInterval(timer);
    };
  }, [live]);
  useEffect(() => {
    let frame = 0;
    const step = (): void => {
      time.current = Math.min(1, (performance.now() - live.arrived) / TICK_MS);
      frame = requestAnimationFrame(step);
    };
    step();
    return () => {
      cancelAnimationFrame(frame);
    };
  }, [live]);
  const clock: Clock = { time, shown: 1, playing, speed: "1", setSpeed: nothing, seek: nothing, toggle: nothing };
  return (
    <Stage bounds={bounds} height={440} label="The machine that is driven">
      <Surroundings scenario={scenario} time={seconds} />
      <Film machine={machine} trial={live.trial} clock={clock} follow loads={null} terrain={scenario.terrain} />
    </Stage>
  );
}
