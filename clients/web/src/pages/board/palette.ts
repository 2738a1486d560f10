/** Okabe and Ito's colours, which people of all eyes can tell apart; a dash or a word always stands beside them. */
export const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#999999"] as const;
export const DASHES = ["none", "7 3", "2 3", "9 3 2 3"] as const;

export function strokeOf(index: number): { stroke: string; strokeDasharray: string } {
  return {
    stroke: COLOURS[index % COLOURS.length] ?? "currentColor",
    strokeDasharray: DASHES[index % DASHES.length] ?? "none",
  };
}
