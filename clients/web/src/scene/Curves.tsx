import { SimpleGrid, Text } from "@mantine/core";
import { useMemo } from "react";
import { number } from "../format";
import type { Curve } from "./curves";
import { instantAt } from "./trial";

const WIDTH = 400;
const HEIGHT = 70;
const POINTS = 200;

/** Figures over the time of a trial, with a line at the moment that is shown; a click seeks. */
export function Curves({
  curves,
  times,
  now,
  breaks,
  seek,
}: {
  curves: readonly Curve[];
  times: Float64Array;
  now: number;
  breaks: readonly number[];
  seek: (time: number) => void;
}) {
  const end = times.at(-1) ?? 1;
  const { index } = instantAt(times, now);
  const drawn = useMemo(
    () =>
      curves.map((curve) => {
        const [low, high] = [Math.min(...curve.values), Math.max(...curve.values)];
        return { curve, low, high, path: outline(curve.values, times, low, high) };
      }),
    [curves, times],
  );
  return (
    <SimpleGrid cols={{ base: 1, sm: 2 }}>
      {drawn.map(({ curve, low, high, path }) => {
        return (
          <figure key={curve.name} style={{ margin: 0 }}>
            <Text size="xs" component="figcaption">
              {curve.name}: <b className="figures">{number(curve.values[index] ?? null)}</b> {curve.unit}{" "}
              <span className="dimmed">
                ({number(low)} to {number(high)})
              </span>
            </Text>
            <svg
              viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
              preserveAspectRatio="none"
              width="100%"
              height={HEIGHT}
              role="img"
              aria-label={`${curve.name} from ${number(low)} to ${number(high)} ${curve.unit}`}
              onClick={(event) => {
                const box = event.currentTarget.getBoundingClientRect();
                seek((end * (event.clientX - box.left)) / box.width);
              }}
            >
              <rect width={WIDTH} height={HEIGHT} fill="currentColor" fillOpacity={0.04} />
              {breaks.map((time, item) => (
                <line
                  key={item}
                  x1={(WIDTH * time) / end}
                  x2={(WIDTH * time) / end}
                  y1={0}
                  y2={HEIGHT}
                  stroke="var(--mantine-color-red-6)"
                  strokeDasharray="3 3"
                />
              ))}
              <path
                d={path}
                fill="none"
                stroke="var(--mantine-primary-color-filled)"
                strokeWidth={2}
                vectorEffect="non-scaling-stroke"
              />
              <line
                x1={(WIDTH * now) / end}
                x2={(WIDTH * now) / end}
                y1={0}
                y2={HEIGHT}
                stroke="currentColor"
                vectorEffect="non-scaling-stroke"
              />
            </svg>
          </figure>
        );
      })}
    </SimpleGrid>
  );
}

function outline(values: Float64Array, times: Float64Array, low: number, high: number): string {
  const end = times.at(-1) ?? 1;
  const step = Math.max(1, Math.floor(values.length / POINTS));
  const points: string[] = [];
  for (let i = 0; i < values.length; i += step) {
    const x = (WIDTH * (times[i] ?? 0)) / end;
    const y = HEIGHT - 4 - ((HEIGHT - 8) * ((values[i] ?? 0) - low)) / Math.max(high - low, 1e-9);
    points.push(`${x.toFixed(1)},${y.toFixed(1)}`);
  }
  return `M${points.join("L")}`;
}
