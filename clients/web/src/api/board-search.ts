/** What the address of the board says; everything else follows from it. */
export interface BoardSearch {
  track?: string;
  task?: string[];
  /** Categories of tasks; without, of all. */
  category?: string[];
  baselines?: "no";
}

function text(value: unknown): string | undefined {
  return typeof value === "string" && value !== "" ? value : undefined;
}

function list(value: unknown): string[] | undefined {
  const entries = (Array.isArray(value) ? value : [value]).map(text).filter((one) => one !== undefined);
  return entries.length > 0 ? entries : undefined;
}

/** Reads an address as far as it makes sense; addresses from elsewhere are input too. */
export function readSearch(raw: Record<string, unknown>): BoardSearch {
  return {
    track: text(raw.track),
    task: list(raw.task),
    category: list(raw.category),
    baselines: raw.baselines === "no" ? "no" : undefined,
  };
}
