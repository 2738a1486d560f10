import { describe, expect, it } from "vitest";
import { clicked, sortedRows } from "./sorting";

describe("a table", () => {
  const rows = [{ n: 2 }, { n: null }, { n: 10 }, { n: 1 }];
  const values = [{ name: "n", label: "N", value: (row: { n: number | null }) => row.n }];

  it("is sorted in both directions, and what has no value comes last", () => {
    const shown = (descending: boolean): (number | null)[] =>
      sortedRows(rows, { by: "n", descending }, values).map((row) => row.n);
    expect(shown(true)).toEqual([10, 2, 1, null]);
    expect(shown(false)).toEqual([1, 2, 10, null]);
    expect(sortedRows(rows, null, values)).toBe(rows);
    expect(sortedRows(rows, { by: "other", descending: true }, values)).toBe(rows);
  });

  it("begins with the greatest figure, or the first name, and turns round with the second click", () => {
    const first = clicked(null, "cost", true);
    expect(first).toEqual({ by: "cost", descending: true });
    expect(clicked(first, "cost", true).descending).toBe(false);
    expect(clicked(first, "model", false)).toEqual({ by: "model", descending: false });
  });
});
