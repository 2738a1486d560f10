import { Text } from "@mantine/core";
import { useMemo } from "react";
import { number } from "../format";
import { sidePath } from "./flight";
import { instantAt, type Trial } from "./trial";

const SIZE = 180;
const REACH = 0.46 * SIZE;

/** The planet from the side, with the path so far; `trial` is as it was recorded. */
export function FlightMap({ trial, radius, now }: { trial: Trial; radius: number; now: number }) {
  const path = useMemo(() => sidePath(trial, radius), [trial, radius]);
  const scale = REACH / Math.max(radius, ...path.map(([x, y]) => Math.hypot(x, y)));
  const { index } = instantAt(trial.times, now);
  const points = path.slice(0, index + 1).map(([x, y]) => `${(scale * x).toFixed(1)},${(-scale * y).toFixed(1)}`);
  const [x, y] = path[index] ?? [0, radius];
  const height = Math.hypot(x, y) - radius;
  return (
    <figure style={{ margin: 0, width: SIZE }} data-flight-map>
      <svg
        viewBox={`${-SIZE / 2} ${-SIZE / 2} ${SIZE} ${SIZE}`}
        width={SIZE}
        height={SIZE}
        role="img"
        aria-label={`The planet from the side, with the path so far: ${number(height, 0)} units above the ground`}
      >
        <circle r={scale * radius} fill="var(--mantine-color-default-hover)" stroke="var(--mantine-color-dimmed)" />
        <polyline points={points.join(" ")} fill="none" stroke="#c2410c" strokeWidth={1.5} />
        <circle cx={scale * x} cy={-scale * y} r={3} fill="currentColor" />
      </svg>
      <Text size="xs" component="figcaption" className="figures">
        {number(height, 1)} units above the ground
      </Text>
    </figure>
  );
}
