import { Stack, Text } from "@mantine/core";
import { useMemo } from "react";
import { Box3, Vector3 } from "three";
import { CargoSolid } from "./CargoSolid";
import { Stage } from "./Stage";
import { posts } from "./signs";
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
    for (const gate of scenario.gates ?? [])
      for (const post of posts(gate)) whole.expandByPoint(new Vector3(...post).clampLength(0, SEEN));
    for (const mark of scenario.marks ?? []) whole.expandByPoint(new Vector3(...mark.center).clampLength(0, SEEN));
    return whole;
  }, [scenario]);
  const height = cargoHeight(scenario);
  return (
    <Stack gap="xs">
      <Stage
        bounds={bounds}
        height={320}
        scenario={scenario}
        label="The course: the red cube marks the machine’s place"
      >
        <Surroundings scenario={scenario} />
        {scenario.cargo !== null && (
          <mesh
            position={cargoPlace(scenario.cargo, height)}
            rotation={[0, 0, (-(scenario.cargo.heading_deg ?? 0) * Math.PI) / 180]}
          >
            <CargoSolid size={scenario.cargo.size} shape={scenario.cargo.shape ?? "box"} />
          </mesh>
        )}
        <mesh position={[0, 0, scenario.placement.lowest_center ?? 0.5 + (scenario.placement.height ?? 0)]}>
          <boxGeometry args={[1, 1, 1]} />
          <meshLambertMaterial color="#cc5c45" transparent opacity={0.6} />
        </mesh>
      </Stage>
      <Text size="sm">The trial lasts {scenario.duration_s} seconds; the red cube marks the machine’s place.</Text>
    </Stack>
  );
}

function cargoHeight(scenario: Scenario): number {
  const lowest = scenario.placement.lowest_center ?? 0.5;
  return lowest + 1 + (scenario.cargo?.drop_height ?? 0) + (scenario.cargo?.size[2] ?? 0) / 2;
}

function cargoPlace({ at, size }: NonNullable<Scenario["cargo"]>, height: number): [number, number, number] {
  return at == null ? [0, 0, height] : [at[0], at[1], at[2] + size[2] / 2];
}
