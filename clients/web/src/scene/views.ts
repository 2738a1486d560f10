import { Box3, Vector3 } from "three";
import type { Scenario } from "./Surroundings";
import { instantAt, type Trial } from "./trial";

/** Down from the south-east. */
const USUAL = new Vector3(0.62, -0.85, 0.5).normalize();
/** Low from the east, along a gap: both its banks are in the picture, and how far a bridge sags. */
const ALONG_GAP = new Vector3(1, -0.34, 0.24).normalize();
/** How much of each bank is shown, units. */
const BANK = 2;

/** From where a course is seen at first, by what there is on it. */
export function viewOf(scenario: Scenario | null): Vector3 {
  return scenario?.placement.gap === undefined ? USUAL : ALONG_GAP;
}

/** What the first look takes in: the machine, and the banks of a gap if there is one. */
export function framed(machine: Box3, scenario: Scenario | null): Box3 {
  const gap = scenario?.placement.gap;
  if (gap === undefined || machine.isEmpty()) return machine;
  const [middle, reach] = [machine.getCenter(new Vector3()), gap / 2 + BANK];
  const banks = [-reach, reach].map((y) => new Vector3(middle.x, y, machine.min.z));
  return machine.clone().union(new Box3().setFromPoints(banks));
}

/** What a picture says from the first break on: "601 held, broke at 5.6 s". */
export function breakCaption({ breaks, cargo, times }: Trial, time: number): string | null {
  const first = breaks[0]?.time_s;
  if (first === undefined || time < first) return null;
  const mass = cargo?.mass ?? new Float64Array();
  const grows = (mass.at(-1) ?? 0) > (mass[0] ?? 0);
  const held = Math.round(mass[instantAt(times, first).index] ?? 0).toLocaleString("en");
  return `${grows ? `${held} held, broke` : "Broke"} at ${first.toFixed(1)} s`;
}
