const ARROW = /^Arrow(Up|Down|Left|Right)$/;
const DIGIT = /^(Digit|Numpad)([0-9])$/;

/** The machine's key that a key of the keyboard is; null for one that no machine has. */
export function keyOf(code: string): string | null {
  const arrow = ARROW.exec(code);
  if (arrow !== null) return `${arrow[1] ?? ""}Arrow`;
  const digit = DIGIT.exec(code);
  if (digit === null) return null;
  return `${digit[1] === "Digit" ? "Alpha" : "Keypad"}${digit[2] ?? ""}`;
}

const SIGNS: Record<string, string> = { UpArrow: "↑", DownArrow: "↓", LeftArrow: "←", RightArrow: "→" };

/** What stands on a machine's key. */
export function signOf(key: string): string {
  return SIGNS[key] ?? key.replace("Alpha", "").replace("Keypad", "num ");
}
