import { readSearch, type BoardSearch } from "../../api/board-search";

/** What of a board's address a comparison of models keeps: the same jobs are compared that the board counts. */
export type Scoped = Pick<BoardSearch, "track" | "category" | "task">;

/** What is compared: two jobs, or two models on the jobs of a board. */
export interface CompareSearch extends Scoped {
  a?: string;
  b?: string;
  models?: string;
}

const NAMES = ["a", "b", "models"] as const;

/** A board's choice of jobs, without what only changes how the board looks. */
export function scoped({ track, category, task }: BoardSearch): Scoped {
  return { track, category, task };
}

export function readCompareSearch(raw: Record<string, unknown>): CompareSearch {
  const found = NAMES.flatMap((name) => {
    const value = raw[name];
    return typeof value === "string" && value.trim() !== "" ? [[name, value.trim()]] : [];
  });
  return { ...scoped(readSearch(raw)), ...(Object.fromEntries(found) as CompareSearch) };
}
