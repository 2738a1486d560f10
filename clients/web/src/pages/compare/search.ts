/** What is compared: two jobs, or two models on one track. */
export interface CompareSearch {
  a?: string;
  b?: string;
  models?: string;
  track?: string;
}

const NAMES = ["a", "b", "models", "track"] as const;

export function readCompareSearch(raw: Record<string, unknown>): CompareSearch {
  const found = NAMES.flatMap((name) => {
    const value = raw[name];
    return typeof value === "string" && value.trim() !== "" ? [[name, value.trim()]] : [];
  });
  return Object.fromEntries(found) as CompareSearch;
}
