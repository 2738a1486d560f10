import type { JobDetail } from "../../api/queries";
import { number } from "../../format";

type World = JobDetail["worlds"][number];

/** "Exact world", or "World 2" for the second of those in which something is changed. */
export function worldName(world: World, worlds: readonly World[]): string {
  const varied = worlds.filter((one) => !one.exact);
  return world.exact ? "Exact world" : `World ${varied.indexOf(world) + 1}`;
}

/** A scored trial in a line: what it came to, or why it failed. */
export function worldLine(world: World, worlds: readonly World[]): string {
  const name = worldName(world, worlds);
  const same = !world.exact && worlds.some((one) => one.exact && one.explanation === world.explanation);
  return world.success ? `✓ ${name} ${number(world.indicator)}` : `✗ ${name}: ${same ? "the same" : world.explanation}`;
}
