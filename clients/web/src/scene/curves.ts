import type { Piloting, Trial } from "./trial";

export interface Curve {
  name: string;
  unit: string;
  values: Float64Array;
}

function distances(positions: Float32Array, count: number): Float64Array {
  const [x, y] = [positions[0] ?? 0, positions[1] ?? 0];
  return Float64Array.from({ length: count }, (_, i) =>
    Math.hypot((positions[3 * i] ?? 0) - x, (positions[3 * i + 1] ?? 0) - y),
  );
}

/** A blow in a collapse is many times a joint's strength, and would flatten all that led to it. */
const MOST_SHOWN = 120;

function largestLoads(loads: Float32Array, joints: number, count: number): Float64Array {
  return Float64Array.from({ length: count }, (_, i) => {
    let most = 0;
    for (let joint = i * joints; joint < (i + 1) * joints; joint += 1) most = Math.max(most, loads[joint] ?? 0);
    return Math.min(MOST_SHOWN, 100 * most);
  });
}

/** What a trial is judged by, over time: loads, and the cargo. */
export function curvesOf(trial: Trial): Curve[] {
  const count = trial.times.length;
  const curves: Curve[] = [];
  if (trial.loads !== null) {
    curves.push({
      name: "Largest load on a joint",
      unit: "% of its strength, shown up to 120",
      values: largestLoads(trial.loads, trial.peaks.length, count),
    });
  }
  if (trial.cargo !== null) {
    curves.push({ name: "Distance of the cargo", unit: "units", values: distances(trial.cargo.positions, count) });
    curves.push({ name: "Mass of the cargo", unit: "mass units", values: trial.cargo.mass });
  }
  return curves;
}

/** What of a program is drawn unless others are chosen: how far it asked for its first actions. */
export function firstNames({ actionNames }: Piloting): string[] {
  return actionNames.slice(0, 6);
}

/** What a program sensed or asked for, over the time of a trial; of names that it does not have, nothing. */
export function pilotingCurves(piloting: Piloting, names: readonly string[]): Curve[] {
  const column = (of: Float32Array, width: number, at: number): Float64Array => {
    const values = Float64Array.from({ length: of.length / width }, (_, i) => of[i * width + at] ?? NaN);
    // Nobody asks at the last instant: it stays where it was.
    const last = values.length - 1;
    if (last > 0 && Number.isNaN(values[last])) values[last] = values[last - 1] ?? NaN;
    return values;
  };
  return names.flatMap((name) => {
    const action = piloting.actionNames.indexOf(name);
    if (action >= 0)
      return [{ name, unit: "asked for", values: column(piloting.answers, piloting.actionNames.length, action) }];
    const sense = piloting.senseNames.indexOf(name);
    if (sense < 0) return [];
    return [{ name, unit: "sensed", values: column(piloting.senses, piloting.senseNames.length, sense) }];
  });
}
