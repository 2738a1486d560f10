/** What the address of the workroom says: which session, or which task a new one is for. */
export interface BuildSearch {
  session?: string;
  task?: string;
  /** The job whose machine a new session begins with. */
  remix?: string;
}

const ID = /^job_[0-9a-f]{1,40}$/;
const NAME = /^[a-z0-9-]{1,60}$/;

export function readBuildSearch(raw: Record<string, unknown>): BuildSearch {
  const taken = (value: unknown, form: RegExp): string | undefined =>
    typeof value === "string" && form.test(value) ? value : undefined;
  return { session: taken(raw.session, ID), task: taken(raw.task, NAME), remix: taken(raw.remix, ID) };
}
