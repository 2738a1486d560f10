/** What a score is, for whoever points at its heading. */
export const SCORE =
  "The indicator beside the built-in expert's on a log scale: 0 nothing, 1 as much as the expert, 2 three times as much";

/** Ranks that several models share. */
export function sharedRanks(rows: readonly { rank: number | null }[]): Set<number> {
  const seen = new Set<number>();
  const shared = new Set<number>();
  for (const { rank } of rows) {
    if (rank === null) continue;
    if (seen.has(rank)) shared.add(rank);
    seen.add(rank);
  }
  return shared;
}
