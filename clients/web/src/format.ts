/** Figures and times as people read them. */
const NONE = "–";

/** A number in digits, thousands apart. Not by Intl, which takes 30 ms to be made while a page waits. */
function written(value: number, least = 0, most = least): string {
  const [whole = "", part = ""] = value.toFixed(most).split(".");
  const shown = part.replace(/0+$/, "").padEnd(least, "0");
  return whole.replace(/\B(?=(\d{3})+$)/g, ",") + (shown === "" ? "" : `.${shown}`);
}

export function number(value: number | null | undefined, digits = 1): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  const size = Math.abs(value);
  const shown = size >= 1000 ? 0 : size !== 0 && size < 0.1 ? Math.max(digits, 3) : digits;
  return written(value, shown);
}

export function count(value: number | null | undefined): string {
  return value === null || value === undefined ? NONE : written(Math.round(value));
}

export function percent(share: number | null | undefined, digits = 0): string {
  return share === null || share === undefined ? NONE : `${(100 * share).toFixed(digits)} %`;
}

/** Successes of trials, which are worth a share each where worlds vary: "3" or "2.75". */
export function successes(value: number): string {
  return written(value, 0, 2);
}

export function dollars(value: number | null | undefined): string {
  if (value === null || value === undefined) return NONE;
  const digits = value !== 0 && Math.abs(value) < 0.1 ? 4 : 2;
  return `$${written(value, digits)}`;
}

export function compact(value: number | null | undefined): string {
  if (value === null || value === undefined) return NONE;
  return new Intl.NumberFormat("en", { maximumFractionDigits: 1, notation: "compact" }).format(value);
}

export function bytes(size: number): string {
  if (size < 1024) return `${size} B`;
  const mebibytes = size / 1024 / 1024;
  return mebibytes < 1 ? `${(size / 1024).toFixed(1)} KiB` : `${mebibytes.toFixed(1)} MiB`;
}

/** "2 h 5 min", for a time in seconds. */
export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return NONE;
  if (seconds < 1) return `${Math.round(1000 * seconds)} ms`;
  if (seconds < 60) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 60) return `${minutes} min`;
  const hours = Math.floor(minutes / 60);
  if (hours < 48) return `${hours} h ${minutes % 60} min`;
  return `${Math.round(hours / 24)} days`;
}

/** A place, with the interval that holds it: "1" or "1–3". */
export function places(low: number | null, high: number | null): string {
  if (low === null || high === null) return NONE;
  return low === high ? String(low) : `${low}–${high}`;
}

/** "1 run", "2 runs": a number with its word. */
export function counted(value: number, one: string, many = `${one}s`): string {
  return `${count(value)} ${value === 1 ? one : many}`;
}

/** A name as the title of something: "My own". */
export function titled(name: string): string {
  return words(name).replace(/^./, (first) => first.toUpperCase());
}

export function words(name: string): string {
  return name.replaceAll("_", " ");
}

const STATES: Readonly<Record<string, string>> = {
  "construct queued": "waiting to be built",
  "construct running": "being built",
  "construct on_hold": "on hold before they are built",
  "simulate queued": "waiting for their trial",
  "simulate running": "in their trial",
  "simulate on_hold": "on hold before their trial",
  budget_exhausted: "stopped: budget used up",
  success: "succeeded",
  unsuccessful: "failed its trial",
  construction_failed: "didn’t finish building",
  limit: "hit a limit",
  excluded: "left out by the paper's protocol",
  errored: "hit an error (not counted)",
};

/** What a state or an outcome is called where people read it. */
export function stateWords(name: string): string {
  return STATES[name] ?? words(name);
}

/** What is measured, with its unit; a ratio has none. */
export function measured(indicator: string, unit: string): string {
  if (unit === "1") return words(indicator);
  const per = /^1\/(\w+?)s?$/.exec(unit)?.[1];
  return per === undefined ? `${words(indicator)}, ${unit}` : `${words(indicator)}, per ${per}`;
}

/** "five-role · pybullet 3", for a track's long name. */
export function trackLabel(track: string): string {
  const [workflow, simulator, prompts] = track.split("/");
  if (workflow === undefined || simulator === undefined || prompts === undefined) return track;
  const [name, hash] = prompts.split("-");
  return `${workflow} · ${simulator.replace(/-(\d+)$/, " $1")} · ${name ?? ""} prompts ${hash ?? ""}`;
}

export function secondsBetween(from: string | null, to: string | null): number | null {
  if (from === null || to === null) return null;
  return (Date.parse(to) - Date.parse(from)) / 1000;
}

let moments: Intl.DateTimeFormat | undefined;

/** A moment in the reader's zone, in an unmistakable order: "26 Nov 2026, 06:05". */
export function moment(time: string): string {
  moments ??= new Intl.DateTimeFormat("en-GB", { dateStyle: "medium", timeStyle: "short" });
  return moments.format(new Date(time));
}
