/** Okabe and Ito's colours, which people of all eyes can tell apart; a dash or a word always stands beside them. */
export const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#999999"] as const;
const SUCCESS = "#009e73";
export const OTHER = { name: "other", colour: "#999999" } as const;
const OTHERS = COLOURS.filter((colour) => colour !== SUCCESS && colour !== OTHER.colour);
/** Kinds that a drawing tells apart; the rest is "other". */
export const MOST = 6;

/**
 * The colour of each kind, always the same for a kind: success has its own, any other one that its letters choose. Of
 * two that choose the same, the first keeps it, and the second takes the next that is free.
 *
 * @param kinds - The most frequent first; at most `MOST`.
 */
export function coloursOf(kinds: readonly string[]): string[] {
  const taken = new Set<string>();
  return kinds.map((kind) => {
    if (kind === "success") return SUCCESS;
    if (kind === OTHER.name) return OTHER.colour;
    const letters = Array.from(kind).reduce((sum, letter) => (31 * sum + (letter.codePointAt(0) ?? 0)) % 1_000_003, 7);
    for (let turn = 0; turn < OTHERS.length; turn++) {
      const colour = OTHERS[(letters + turn) % OTHERS.length] ?? OTHER.colour;
      if (taken.has(colour)) continue;
      taken.add(colour);
      return colour;
    }
    return OTHER.colour;
  });
}

export const DASHES = ["none", "7 3", "2 3", "9 3 2 3"] as const;

export function strokeOf(index: number): { stroke: string; strokeDasharray: string } {
  return {
    stroke: COLOURS[index % COLOURS.length] ?? "currentColor",
    strokeDasharray: DASHES[index % DASHES.length] ?? "none",
  };
}
