import type { Schema } from "../../api/client";

export interface TurnAction {
  name: string;
  arguments: unknown;
  ok: boolean;
  reason: string | null;
  feedback: string;
}

/** A turn, as transcripts keep it. */
export interface Turn {
  index: number;
  stage: string;
  sub_structure: string | null;
  role: string;
  text: string;
  actions: TurnAction[];
  finish?: string;
  input_tokens?: number;
  output_tokens?: number;
  cost_usd?: string;
  latency_s?: number;
  tries?: number;
}

/** What a role was given before a turn. */
export type Prompt = Schema<"Prompt">;

/** The messages of a prompt, each with what it is. */
export function messagesOf(prompt: Prompt): { kind: "system" | "user"; text: string }[] {
  return [
    ...(prompt.system === null ? [] : [{ kind: "system" as const, text: prompt.system }]),
    ...prompt.user.map((text) => ({ kind: "user" as const, text })),
  ];
}

export interface Transcript {
  version: number;
  turns: Turn[];
}

export const ROLE_COLOURS: Readonly<Record<string, string>> = {
  planner: "violet",
  drafter: "indigo",
  reviewer: "grape",
  builder: "teal",
  guidance: "orange",
  controller: "cyan",
  analyst: "pink",
};

export interface TurnFilter {
  role: string | null;
  refusedOnly: boolean;
  text: string;
}

/** The turns that a reader asks for. */
export function chosenTurns(turns: readonly Turn[], filter: TurnFilter): Turn[] {
  const wanted = filter.text.trim().toLowerCase();
  return turns.filter(
    (turn) =>
      (filter.role === null || turn.role === filter.role) &&
      (!filter.refusedOnly || turn.actions.some((action) => !action.ok)) &&
      (wanted === "" || searchable(turn).includes(wanted)),
  );
}

function searchable(turn: Turn): string {
  const actions = turn.actions.map((action) => `${action.name} ${JSON.stringify(action.arguments)} ${action.feedback}`);
  return [turn.text, ...actions].join("\n").toLowerCase();
}

/** An action's call as one line. */
export function callLine(action: Pick<TurnAction, "name" | "arguments">): string {
  if (typeof action.arguments !== "object" || action.arguments === null)
    return `${action.name}(${JSON.stringify(action.arguments)})`;
  const words = Object.entries(action.arguments).map(([name, value]) => `${name}=${JSON.stringify(value)}`);
  return `${action.name}(${words.join(", ")})`;
}
