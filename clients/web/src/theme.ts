import { createTheme } from "@mantine/core";

export const theme = createTheme({
  primaryColor: "blue",
  primaryShade: 8,
  autoContrast: true,
  luminanceThreshold: 0.35,
  fontFamily: "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', sans-serif",
  fontFamilyMonospace: "ui-monospace, SFMono-Regular, Menlo, 'DejaVu Sans Mono', monospace",
  headings: { fontWeight: "650", sizes: { h1: { fontSize: "1.6rem" }, h2: { fontSize: "1.15rem" } } },
  defaultRadius: "md",
  cursorType: "pointer",
  // The options of a closed list are not made, and nothing is measured to place them.
  components: { Combobox: { defaultProps: { keepMounted: false } } },
});

/** A colour for each outcome and state of a job; a word is always next to it. */
export const OUTCOME_COLOURS: Readonly<Record<string, string>> = {
  success: "teal",
  unsuccessful: "orange",
  construction_failed: "red",
  limit: "grape",
  excluded: "gray",
  errored: "pink",
  cancelled: "gray",
  running: "blue",
  queued: "gray",
  on_hold: "yellow",
};
