/** A row of two lists put side by side: what both have, or what only one has. */
export interface Pair {
  a: number | null;
  b: number | null;
  same: boolean;
}

const LONGEST = 1500;

/** Two lists side by side, equal entries beside each other (a longest common subsequence). */
export function aligned(first: readonly string[], second: readonly string[]): Pair[] {
  const [n, m] = [Math.min(first.length, LONGEST), Math.min(second.length, LONGEST)];
  const width = m + 1;
  const longest = new Uint16Array((n + 1) * width);
  for (let i = n - 1; i >= 0; i -= 1) {
    for (let j = m - 1; j >= 0; j -= 1) {
      const both = first[i] === second[j] ? (longest[(i + 1) * width + j + 1] ?? 0) + 1 : 0;
      longest[i * width + j] = Math.max(both, longest[(i + 1) * width + j] ?? 0, longest[i * width + j + 1] ?? 0);
    }
  }
  const pairs: Pair[] = [];
  let [i, j] = [0, 0];
  while (i < n && j < m) {
    if (first[i] === second[j]) pairs.push({ a: i++, b: j++, same: true });
    else if ((longest[(i + 1) * width + j] ?? 0) >= (longest[i * width + j + 1] ?? 0))
      pairs.push({ a: i++, b: null, same: false });
    else pairs.push({ a: null, b: j++, same: false });
  }
  while (i < n) pairs.push({ a: i++, b: null, same: false });
  while (j < m) pairs.push({ a: null, b: j++, same: false });
  return beside(pairs);
}

/** Puts what only one has beside what only the other has, as far as both last. */
function beside(pairs: readonly Pair[]): Pair[] {
  const rows: Pair[] = [];
  let [a, b]: [number[], number[]] = [[], []];
  const close = (): void => {
    for (let k = 0; k < Math.max(a.length, b.length); k += 1)
      rows.push({ a: a[k] ?? null, b: b[k] ?? null, same: false });
    [a, b] = [[], []];
  };
  for (const pair of pairs) {
    if (pair.same) {
      close();
      rows.push(pair);
    } else {
      if (pair.a !== null) a.push(pair.a);
      if (pair.b !== null) b.push(pair.b);
    }
  }
  close();
  return rows;
}
