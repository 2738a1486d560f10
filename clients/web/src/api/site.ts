/** What `buildarena site` says of a published site; its answers are files next to the pages. */
export interface Site {
  version: 1;
  written_at: string;
  /** Sentences: what the site holds, and what was left out of it. */
  holds: string;
  left_out: string[];
  /** Ids of its sweeps. */
  sweeps: string[];
  /** Jobs with transcript, replay and trials. */
  kept: number;
  /** The file of all jobs' rows. */
  jobs: string;
  /** Files by what is asked for: path, and parameters in order; null where the service had none. */
  answers: Record<string, string | null>;
}

/** Where these pages find the site they show; null where a service answers them. */
export const SITE: string | null =
  typeof document === "undefined"
    ? null
    : (document.querySelector('meta[name="buildarena-site"]')?.getAttribute("content") ?? null);

export const isSite = SITE !== null;

/**
 * The path below which a proxy shows the service, such as "/arena"; "" at a host's root, or when these pages were
 * asked for without it.
 */
export function baseOf(base: string | null | undefined, path: string): string {
  if (base === null || base === undefined) return "";
  return path === base || path.startsWith(`${base}/`) ? base : "";
}

export const BASE: string =
  typeof document === "undefined"
    ? ""
    : baseOf(document.querySelector('meta[name="buildarena-base"]')?.getAttribute("content"), location.pathname);

/** How often something is read again: what is published does not change. */
export const every = (ms: number): number | false => (isSite ? false : ms);

/** The address of a file next to the first page. */
export const siteFile = (name: string): string => (isSite ? `./${name}` : `${BASE}/${name}`);
