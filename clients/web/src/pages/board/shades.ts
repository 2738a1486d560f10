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

/** A figure as a share of the best in its column; logarithmic, as loads range over magnitudes. */
export function shareOf(value: number | null, values: readonly (number | null)[]): number | null {
  if (value === null) return null;
  const known = values.filter((one): one is number => one !== null);
  const most = Math.max(...known);
  if (most <= 0) return 0;
  return Math.log1p(Math.max(0, value)) / Math.log1p(most);
}
