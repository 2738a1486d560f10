/** Where a label stands, px. */
export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

export interface Shift {
  dx: number;
  dy: number;
}

/** Further from its point a label would be taken for another's. */
const MOST_LINES = 2;

const overlap = (a: Box, b: Box): boolean =>
  a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;

/**
 * How labels beside points move so that none covers another or a point, and none leaves a drawing: to the
 * left of its point where there is no room on the right, and up or down by as little as it takes; null for
 * one that has no room near its point.
 *
 * @param points What labels may not cover.
 * @param gap Between a point and its label.
 */
export function apart(
  labels: readonly Box[],
  points: readonly Box[],
  size: { width: number; height: number },
  gap: number,
): (Shift | null)[] {
  const placed = [...points];
  return labels.map((label) => {
    const flips = label.x + label.width > size.width;
    const x = flips ? Math.max(0, label.x - label.width - 2 * gap) : label.x;
    for (let step = 0; step <= 2 * MOST_LINES; step += 1) {
      // 0, one line up, one down, two up, …
      const dy = Math.ceil(step / 2) * (step % 2 === 1 ? -label.height : label.height);
      const box = { ...label, x, y: label.y + dy };
      if (box.y < 0 || box.y + box.height > size.height || placed.some((other) => overlap(other, box))) continue;
      placed.push(box);
      return { dx: x - label.x, dy };
    }
    return null;
  });
}
