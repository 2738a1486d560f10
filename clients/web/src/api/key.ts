/** The API key: of this tab, or of this browser where the reader chose so. */
const NAME = "buildarena-key";
const listeners = new Set<() => void>();

export function key(): string | null {
  return sessionStorage.getItem(NAME) ?? localStorage.getItem(NAME);
}

/** Whether the key stays in this browser, for other tabs and later visits. */
export function keyStays(): boolean {
  return localStorage.getItem(NAME) !== null;
}

export function setKey(value: string | null, stays = false): void {
  sessionStorage.removeItem(NAME);
  localStorage.removeItem(NAME);
  const text = value?.trim() ?? "";
  if (text !== "") (stays ? localStorage : sessionStorage).setItem(NAME, text);
  for (const listener of listeners) listener();
}

export function onKey(listener: () => void): () => void {
  const elsewhere = (event: StorageEvent): void => {
    if (event.key === NAME || event.key === null) listener();
  };
  listeners.add(listener);
  window.addEventListener("storage", elsewhere);
  return () => {
    listeners.delete(listener);
    window.removeEventListener("storage", elsewhere);
  };
}

export function authorization(): Record<string, string> {
  const known = key();
  return known === null ? {} : { Authorization: `Bearer ${known}` };
}
