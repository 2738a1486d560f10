/** A length that is easy to read, of 1, 2 or 5 times a power of ten, at most so long. */
export function roundLength(most: number): number {
  const power = 10 ** Math.floor(Math.log10(Math.max(1e-6, most)));
  const step = [5, 2, 1].find((times) => times * power <= most) ?? 1;
  return step * power;
}

/** Degrees clockwise by which an arrow to the north is turned on the screen, seen by a camera that looks so. */
export function northOnScreen(ahead: { x: number; y: number }): number {
  return (-Math.atan2(ahead.x, ahead.y) * 180) / Math.PI;
}
