import { useEffect, useRef, useState, type RefObject } from "react";

const REPORT_EVERY_MS = 120;
export const SPEEDS = ["0.25", "1", "2", "4"] as const;

export interface Clock {
  /** The time now, for what is drawn each frame. */
  time: RefObject<number>;
  /** The time as last shown, for texts. */
  shown: number;
  playing: boolean;
  speed: string;
  setSpeed: (speed: string) => void;
  seek: (to: number) => void;
  toggle: () => void;
}

/** Who asked for less motion starts films by hand. */
const isStill = (): boolean => matchMedia("(prefers-reduced-motion: reduce)").matches;

/** The time of a trial, which plays, stops and can be set; `begins` says that it plays by itself, fast. */
export function useClock(end: number, first = 0, begins = false): Clock {
  const time = useRef(Math.min(end, first));
  const [shown, setShown] = useState(Math.min(end, first));
  const [fast] = useState(() => begins && !isStill());
  const [playing, setPlaying] = useState(fast);
  const [speed, setSpeed] = useState(fast ? "2" : "1");
  useEffect(() => {
    if (!playing) return;
    let frame = 0;
    let before = performance.now();
    let reported = before;
    const step = (now: number): void => {
      time.current = Math.min(end, time.current + (Math.max(0, now - before) / 1000) * Number(speed));
      before = now;
      if (now - reported > REPORT_EVERY_MS || time.current >= end) {
        reported = now;
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
    time.current = Math.min(end, Math.max(0, to));
    setShown(time.current);
  };
  const toggle = (): void => {
    if (!playing && time.current >= end) seek(0);
    setPlaying(!playing);
  };
  return { time, shown, playing, speed, setSpeed, seek, toggle };
}
