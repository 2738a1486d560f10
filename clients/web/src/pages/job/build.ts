import { useMemo } from "react";
import type { PartView, PlacedView } from "../../scene/machine";
import { builtAt, ghostsOf, placesOf, rangeOf, stepsOf, touchedBy, type Replay, type Step } from "./replay";
import type { JobSearch } from "../../api/jobs-search";
import type { Turn } from "./transcript";

const NO_TURNS: readonly Turn[] = [];

/** How far a machine is built, and what is chosen of it: one thing for machine and transcript. */
export interface Build {
  replay: Replay | null;
  steps: readonly Step[];
  /** The number of the step that is shown. */
  at: number;
  step: Step | undefined;
  /** Whether it continues by itself when a step is added. */
  following: boolean;
  parts: ReadonlyMap<string, PartView>;
  /** The parts that its chapter ends with. */
  whole: ReadonlyMap<string, PartView>;
  ghosts: readonly PlacedView[];
  /** The chosen part. */
  part: string | undefined;
  /** Parts that are marked: the chosen one, or what the step touched. */
  marked: ReadonlySet<string>;
  /** The action that is marked in the transcript, as "turn:action". */
  markedAction: string | null;
  /** The step that made the chosen part. */
  madeBy: number | undefined;
  /** The step of each action of the transcript, by "turn:action". */
  stepOf: ReadonlyMap<string, number>;
  go: (step: number | undefined) => void;
  choose: (part: string | undefined) => void;
}

export function useBuild(
  replay: Replay | null,
  turns: readonly Turn[] | undefined,
  search: JobSearch,
  change: (search: JobSearch) => void,
): Build {
  const steps = useMemo(() => (replay === null ? [] : stepsOf(replay)), [replay]);
  const last = steps.length - 1;
  const following = search.step === undefined || search.step > last;
  const at = following ? last : (search.step ?? last);
  const step = steps[at];
  const built = useMemo(() => builtAt(steps, at), [steps, at]);
  const end = rangeOf(steps, step?.chapter ?? -1)?.[1];
  const whole = useMemo(() => builtAt(steps, end ?? -1).parts, [steps, end]);
  const ghosts = useMemo(() => ghostsOf(step), [step]);
  const places = useMemo(() => placesOf(steps, turns ?? NO_TURNS), [steps, turns]);
  const stepOf = useMemo(
    () => new Map(places.flatMap((place, index) => (place === null ? [] : [[place, index] as const]))),
    [places],
  );
  const part = search.part !== undefined && built.parts.has(search.part) ? search.part : undefined;
  const madeBy = part === undefined ? undefined : built.madeBy.get(part);
  const marked = useMemo<ReadonlySet<string>>(() => {
    if (part !== undefined) return new Set([part]);
    return following ? new Set() : touchedBy(step);
  }, [part, following, step]);
  return {
    replay,
    steps,
    at,
    step,
    following,
    parts: built.parts,
    whole,
    ghosts,
    part,
    marked,
    markedAction: places[madeBy ?? at] ?? null,
    madeBy,
    stepOf,
    go: (to) => {
      change({ step: to === undefined ? undefined : Math.min(last, Math.max(0, to)), part: undefined });
    },
    choose: (chosen) => {
      change({ part: chosen });
    },
  };
}
