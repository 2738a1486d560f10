/** Whose machine is driven: a job's, or a session's as it stands; and where. */
export interface DriveSearch {
  job?: string;
  session?: string;
  task?: string;
}

const ID = /^job_[0-9a-f]{1,40}$/;
const NAME = /^[a-z0-9-]{1,60}$/;

export function readDriveSearch(raw: Record<string, unknown>): DriveSearch {
  const taken = (value: unknown, form: RegExp): string | undefined =>
    typeof value === "string" && form.test(value) ? value : undefined;
  return { job: taken(raw.job, ID), session: taken(raw.session, ID), task: taken(raw.task, NAME) };
}
