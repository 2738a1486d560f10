import type { Task } from "../../api/queries";
import type { BoardSearch } from "../../api/board-search";
import { titled } from "../../format";

/** What a board may be about: all tasks, or those of a category. */
export interface Scope {
  /** The category's name, "" for all. */
  key: string;
  label: string;
}

type Categorised = Pick<Task, "category" | "category_title">;

/** Everything that the tasks allow a board to be about. */
export function scopesOf(tasks: readonly Categorised[]): Scope[] {
  const labels = new Map(tasks.map((task) => [task.category, task.category_title]));
  return [{ key: "", label: "All" }, ...[...labels].map(([key, label]) => ({ key, label }))];
}

/** What the address says that the board is about. */
export function scopeOf({ category = [] }: Pick<BoardSearch, "category">, scopes: readonly Scope[]): Scope {
  const named = category.map((name) => scopes.find(({ key }) => key === name)?.label ?? titled(name));
  return { key: category.join(), label: named.join(", ") };
}
