import { Stack, Text } from "@mantine/core";
import { useMemo } from "react";
import type { Schema } from "../../api/client";
import { Curves } from "../../scene/Curves";
import { useClock } from "../../scene/clock";
import { flightOf } from "../../scene/flight";
import { FlightMap } from "../../scene/FlightMap";
import { TimeLine } from "../../scene/TimeLine";

/** A flight that was recorded: its path round the planet, and its heights over time. */
export default function FlightView({ flight }: { flight: Schema<"FlightView"> }) {
  const trial = useMemo(() => flightOf(flight.time_s, flight.places, flight.center), [flight]);
  const end = flight.time_s.at(-1) ?? 0;
  const clock = useClock(end);
  const first = trial.distances[0] ?? 0;
  const curves = useMemo(
    () => [{ name: "Height over the start", unit: "units", values: trial.distances.map((away) => away - first) }],
    [trial, first],
  );
  return (
    <Stack gap="xs">
      {flight.center === null ? (
        <Text size="sm">The planet's centre is not known, so heights are those of the game's axis.</Text>
      ) : (
        <FlightMap path={trial.path} times={trial.times} radius={first} now={clock.shown} base="the start" />
      )}
      <TimeLine clock={clock} end={end} breaks={[]} />
      <Curves curves={curves} times={trial.times} now={clock.shown} breaks={[]} seek={clock.seek} />
    </Stack>
  );
}
