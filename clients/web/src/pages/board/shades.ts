/** Colours of heat-map cells: from sand to teal, light enough or dark enough for their text. */
export interface Shade {
  background: string;
  color: string;
}

const LIGHT_FROM = [246, 236, 222] as const;
const LIGHT_TO = [96, 190, 170] as const;

/** The shade of a share between 0 and 1. Its text is dark at every share: contrast stays above 7. */
export function shade(share: number): Shade {
  const clamped = Math.min(1, Math.max(0, share));
  const mixed = LIGHT_FROM.map((from, i) => Math.round(from + ((LIGHT_TO[i] ?? from) - from) * clamped));
  return { background: `rgb(${mixed.join(" ")})`, color: "#15202b" };
}
