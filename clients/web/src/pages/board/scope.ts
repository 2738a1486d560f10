import type { Task } from "../../api/queries";
import type { BoardSearch } from "../../api/board-search";
import { words } from "../../format";

/** What a board may be about. */
export interface Scope {
  /** Names it in a list of chips. */
  key: string;
  label: string;
  /** The categories of its tasks; none for all tasks. */
  categories: readonly string[];
}

const ALL: Scope = { key: "", label: "All tasks", categories: [] };
const PAPER: Scope = { key: "paper", label: "The paper’s nine", categories: ["support", "transport", "lift"] };
const LABELS: Readonly<Record<string, string>> = { support: "Bridges", transport: "Vehicles", lift: "Rockets" };

function labelOf(category: string): string {
  const label = LABELS[category] ?? words(category);
  return label.charAt(0).toUpperCase() + label.slice(1);
}

/** Everything that the tasks allow a board to be about. */
export function scopesOf(tasks: readonly Pick<Task, "category">[]): Scope[] {
  const categories = [...new Set(tasks.map((task) => task.category))];
  const paper = PAPER.categories.some((name) => categories.includes(name)) ? [PAPER] : [];
  return [ALL, ...paper, ...categories.map((name) => ({ key: name, label: labelOf(name), categories: [name] }))];
}

/** What the address says that the board is about. */
export function scopeOf(search: Pick<BoardSearch, "category">): Scope {
  const asked = search.category ?? [];
  if (asked.length === 0) return ALL;
  const [only] = asked;
  if (asked.length === 1 && only !== undefined) return { key: only, label: labelOf(only), categories: asked };
  if (asked.length === PAPER.categories.length && PAPER.categories.every((name) => asked.includes(name))) return PAPER;
  return { key: asked.join(), label: asked.map(labelOf).join(", "), categories: asked };
}

const NAMED = 9;

/** A sentence on what the overall ranking is over; empty where there is none. */
export function rankedOver(ranked: readonly string[], shown: number): string {
  if (ranked.length === 0) return "";
  const over = ranked.length > NAMED ? `${ranked.length} tasks` : ranked.join(", ");
  const left = shown - ranked.length;
  const others =
    left === 0 ? "" : `; ${left} other ${left === 1 ? "task" : "tasks"} below ${left === 1 ? "is" : "are"} not in it`;
  return `Ranked over ${over}${others}.`;
}
