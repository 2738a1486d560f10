import { Text } from "@mantine/core";
import { number } from "../format";
import { instantAt } from "./trial";

const SIZE = 180;
const REACH = 0.46 * SIZE;

interface FlightMapProps {
  /** Seen from the planet's centre, its beginning upwards, units. */
  path: readonly (readonly [number, number])[];
  times: Float64Array;
  /** Of the circle that heights are counted from. */
  radius: number;
  now: number;
  /** What heights are counted from. */
  base?: string;
}

/** The planet from the side, with the path, and the part that is flown. */
export function FlightMap({ path, times, radius, now, base = "the ground" }: FlightMapProps) {
  const scale = REACH / Math.max(radius, ...path.map(([x, y]) => Math.hypot(x, y)));
  const { index } = instantAt(times, now);
  const points = path.map(([x, y]) => `${(scale * x).toFixed(1)},${(-scale * y).toFixed(1)}`);
  const [x, y] = path[index] ?? [0, radius];
  const height = Math.hypot(x, y) - radius;
  return (
    <figure style={{ margin: 0, width: SIZE }} data-flight-map>
      <svg
        viewBox={`${-SIZE / 2} ${-SIZE / 2} ${SIZE} ${SIZE}`}
        width={SIZE}
        height={SIZE}
        role="img"
        aria-label={`The planet from the side, with the path so far: ${number(height, 0)} units above ${base}`}
      >
        <circle r={scale * radius} fill="var(--mantine-color-default-hover)" stroke="var(--mantine-color-dimmed)" />
        <polyline points={points.join(" ")} fill="none" stroke="#c2410c" strokeOpacity={0.3} />
        <polyline points={points.slice(0, index + 1).join(" ")} fill="none" stroke="#c2410c" strokeWidth={1.5} />
        <circle cx={scale * x} cy={-scale * y} r={3} fill="currentColor" />
      </svg>
      <Text size="xs" component="figcaption" className="figures">
        {number(height, 1)} units above {base}
      </Text>
    </figure>
  );
}
