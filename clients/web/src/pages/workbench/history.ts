import type { Call } from "./session";

/** Something that was done, which can be undone: calls that were made together, and the parts they made. */
export interface Done {
  calls: readonly Call[];
  made: readonly string[];
}

export interface History {
  past: readonly Done[];
  next: readonly Done[];
}

export const NO_HISTORY: History = { past: [], next: [] };
const MAKING: ReadonlySet<string> = new Set(["attach_block_to", "connect_blocks"]);
/** Tools that change nothing. */
const LOOKING = /^(get|review|list|describe)_/;

/** What undoes it; null for what cannot be undone. */
export function inverseOf({ calls, made }: Done): Call[] | null {
  if (calls.every(({ tool }) => MAKING.has(tool))) {
    return made.map((id): Call => ({ tool: "remove_block", arguments: { block_id: id } })).reverse();
  }
  const [call, ...more] = calls;
  if (call === undefined || more.length > 0) return null;
  if (call.tool === "flip_spin") return [call];
  if (call.tool === "twist_block") {
    return [{ tool: call.tool, arguments: { ...call.arguments, angle: -Number(call.arguments.angle) } }];
  }
  return null;
}

/** The history after something was done by hand. What cannot be undone ends it: nothing before it can be either. */
export function after(history: History, done: Done): History {
  if (done.calls.every(({ tool }) => LOOKING.test(tool))) return history;
  return inverseOf(done) === null ? NO_HISTORY : { past: [...history.past, done], next: [] };
}

/** The same calls with other names of parts: what is done again has new ones. */
export function renamed(done: Done, names: ReadonlyMap<string, string>): Done {
  const own = (value: unknown): unknown => (typeof value === "string" ? (names.get(value) ?? value) : value);
  return {
    made: done.made.map((id) => names.get(id) ?? id),
    calls: done.calls.map(({ tool, arguments: given }) => ({
      tool,
      arguments: Object.fromEntries(
        Object.entries(given).map(([name, value]) => [name, /^(base_)?block(_|$)/.test(name) ? own(value) : value]),
      ),
    })),
  };
}

/** The history after its last entry was undone. */
export function undone({ past, next }: History): History {
  return { past: past.slice(0, -1), next: [...next, ...past.slice(-1)] };
}

/** The history after what was undone last was done again, with the names that its parts have now. */
export function redone({ past, next }: History, done: Done): History {
  const before = next.at(-1)?.made ?? [];
  const names = new Map(before.map((id, index) => [id, done.made[index] ?? id]));
  return { past: [...past, done], next: next.slice(0, -1).map((one) => renamed(one, names)) };
}
