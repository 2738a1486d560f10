import { useEffect, useState } from "react";
import { duration, moment } from "../format";

const EVERY_MS = 10_000;

/** How long ago something was; the exact time, in the reader's zone, on hover. */
export function RelativeTime({ time }: { time: string | null }) {
  const [now, setNow] = useState(() => Date.now());
  useEffect(() => {
    const timer = setInterval(() => {
      setNow(Date.now());
    }, EVERY_MS);
    return () => {
      clearInterval(timer);
    };
  }, []);
  if (time === null) return <>–</>;
  const seconds = Math.max(0, (now - Date.parse(time)) / 1000);
  return (
    <time dateTime={time} title={moment(time)}>
      {seconds < 10 ? "just now" : `${duration(seconds)} ago`}
    </time>
  );
}
