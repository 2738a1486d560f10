/** The API key of this tab: never written where another tab or visit could find it. */
const NAME = "buildarena-key";
const listeners = new Set<() => void>();

export function key(): string | null {
  return sessionStorage.getItem(NAME);
}

export function setKey(value: string | null): void {
  if (value === null || value.trim() === "") sessionStorage.removeItem(NAME);
  else sessionStorage.setItem(NAME, value.trim());
  for (const listener of listeners) listener();
}

export function onKey(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export function authorization(): Record<string, string> {
  const known = key();
  return known === null ? {} : { Authorization: `Bearer ${known}` };
}
