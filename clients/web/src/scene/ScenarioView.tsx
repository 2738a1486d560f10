import { Stack, Text } from "@mantine/core";
import { useMemo } from "react";
import { Box3, Vector3 } from "three";
import { Stage } from "./Stage";
import { Surroundings, type Scenario } from "./Surroundings";

const ROOM = 5;
const SEEN = 30;

/** What a trial puts a machine through: terrain, gap, cargo. */
export default function ScenarioView({ scenario }: { scenario: Scenario }) {
  const bounds = useMemo(() => {
    const whole = new Box3(new Vector3(-ROOM, -ROOM, 0), new Vector3(ROOM, ROOM, 2 * ROOM));
    for (const box of scenario.terrain) {
      const center = new Vector3(...box.center).clampLength(0, SEEN);
      whole.union(new Box3().setFromCenterAndSize(center, new Vector3(...box.size).multiplyScalar(0.5)));
    }
    return whole;
  }, [scenario]);
  const height = cargoHeight(scenario);
  return (
    <Stack gap="xs">
      <Stage bounds={bounds} height={320} label={described(scenario)}>
        <Surroundings scenario={scenario} />
        {scenario.cargo !== null && (
          <mesh position={[0, 0, height]}>
            <boxGeometry args={[...scenario.cargo.size]} />
            <meshLambertMaterial color="#859966" transparent opacity={0.85} />
          </mesh>
        )}
        <mesh position={[0, 0, scenario.placement.lowest_center ?? 0.5]}>
          <boxGeometry args={[1, 1, 1]} />
          <meshLambertMaterial color="#cc5c45" transparent opacity={0.6} />
        </mesh>
      </Stage>
      <Text size="sm">{described(scenario)}</Text>
    </Stack>
  );
}

function cargoHeight(scenario: Scenario): number {
  const lowest = scenario.placement.lowest_center ?? 0.5;
  return lowest + 1 + (scenario.cargo?.drop_height ?? 0) + (scenario.cargo?.size[2] ?? 0) / 2;
}

/** A scenario in a sentence or two. */
export function described(scenario: Scenario): string {
  const place =
    scenario.placement.kind === "span"
      ? `The machine is released above a gap ${scenario.placement.gap ?? "?"} units wide.`
      : "The machine stands on the ground at the origin.";
  const cargo =
    scenario.cargo === null
      ? "There is no cargo."
      : `A cargo of ${scenario.cargo.size.join(" x ")} units is dropped onto it and grows to ${scenario.cargo.final_mass} mass units.`;
  return `${place} ${cargo} The trial lasts ${scenario.duration_s} seconds; the red cube marks the machine's place.`;
}
