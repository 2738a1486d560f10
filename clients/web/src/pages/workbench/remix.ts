import { jsonOf } from "../../api/client";
import { ASSEMBLY, MAIN, type Call } from "./session";
import { make } from "./templates";

interface Logged {
  log: { name: string; arguments: Record<string, unknown>; reason: string | null }[];
  available: Record<string, Logged>;
}

/** How a machine came about, as calls of a session: its sub-structures first. */
export function stepsOf(document: Logged): { machine: string; call: Call }[] {
  const parts = Object.entries(document.available);
  const own = (machine: string, { log }: Logged): { machine: string; call: Call }[] =>
    log
      .filter(({ reason }) => reason === null)
      .map(({ name, arguments: given }) => ({ machine, call: { tool: name, arguments: given } }));
  return [...parts.flatMap(([name, part]) => own(name, part)), ...own(parts.length > 0 ? ASSEMBLY : MAIN, document)];
}

/** Builds a job's machine again in a session that is empty; what is refused there is left out. */
export async function remix(job: string, session: string): Promise<void> {
  const document = await jsonOf<Logged>(`/v1/jobs/${encodeURIComponent(job)}/artifacts/machine`);
  await make(
    stepsOf(document).map(({ machine, call }) => ({ ...call, machine })),
    session,
  );
}
