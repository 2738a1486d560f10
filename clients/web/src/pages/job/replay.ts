import type { Schema } from "../../api/client";
import type { PartView, PlacedView } from "../../scene/machine";
import type { Turn } from "./transcript";

export type Replay = Schema<"Replay">;
export type Step = Schema<"Step"> & {
  /** Place of its chapter in the replay. */
  chapter: number;
};

export interface Built {
  parts: ReadonlyMap<string, PartView>;
  /** The step that added each part. */
  madeBy: ReadonlyMap<string, number>;
}

/** All steps of a replay, chapter after chapter; a step's number is its place here. */
export function stepsOf(replay: Replay): Step[] {
  return replay.chapters.flatMap((chapter, index) => chapter.steps.map((step) => ({ ...step, chapter: index })));
}

/** The machine of a step's chapter after that step; nothing before the first. */
export function builtAt(steps: readonly Step[], at: number): Built {
  const parts = new Map<string, PartView>();
  const madeBy = new Map<string, number>();
  const chapter = steps[at]?.chapter;
  steps.slice(0, at + 1).forEach((step, index) => {
    if (step.chapter !== chapter) return;
    for (const id of step.removed) {
      parts.delete(id);
      madeBy.delete(id);
    }
    for (const part of step.added) {
      parts.set(part.id, part);
      madeBy.set(part.id, index);
    }
    for (const part of [...step.moved, ...step.rebound]) parts.set(part.id, part);
  });
  return { parts, madeBy };
}

/** Where a refused action's blocks would have been. */
export function ghostsOf(step: Step | undefined): readonly PlacedView[] {
  return step === undefined || step.accepted ? [] : step.attempted;
}

/** Parts that a step touched. */
export function touchedBy(step: Step | undefined): ReadonlySet<string> {
  return new Set(step === undefined ? [] : [...step.added, ...step.moved, ...step.rebound].map((part) => part.id));
}

/** Which action of its turn each step is: `places[step]` is "turn:action", or null for the session's own. */
export function placesOf(steps: readonly Step[], turns: readonly Turn[]): (string | null)[] {
  const byIndex = new Map(turns.map((turn) => [turn.index, turn]));
  const taken = new Map<number, number>();
  return steps.map((step) => {
    if (step.turn === null) return null;
    const actions = byIndex.get(step.turn)?.actions ?? [];
    const from = taken.get(step.turn) ?? 0;
    const found = actions.findIndex(
      (action, index) => index >= from && action.name === step.action && action.ok === step.accepted,
    );
    if (found < 0) return `${step.turn}:`;
    taken.set(step.turn, found + 1);
    return `${step.turn}:${found}`;
  });
}

/** The first and last step of a chapter; null for one without steps. */
export function rangeOf(steps: readonly Step[], chapter: number): readonly [number, number] | null {
  const first = steps.findIndex((step) => step.chapter === chapter);
  return first < 0 ? null : [first, steps.findLastIndex((step) => step.chapter === chapter)];
}

const CHAPTERS = { machine: "Machine", sub_structure: "Sub-structure", assembly: "Assembly" } as const;

export function chapterTitle(chapter: Replay["chapters"][number]): string {
  return chapter.kind === "sub_structure" ? `${CHAPTERS.sub_structure} ${chapter.name}` : CHAPTERS[chapter.kind];
}

/** Adds turns from events in their places; a turn given twice is there once. */
export function withTurns(known: readonly Turn[], added: readonly Turn[]): Turn[] {
  const byIndex = new Map([...known, ...added].map((turn) => [turn.index, turn]));
  return [...byIndex.values()].sort((a, b) => a.index - b.index);
}

/** Whether every turn from the first on is there. */
export function isWhole(turns: readonly Turn[]): boolean {
  return turns.every((turn, place) => turn.index === place);
}
