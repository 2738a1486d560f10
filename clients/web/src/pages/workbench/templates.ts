import { client, taken } from "../../api/client";
import { MAIN, type Call } from "./session";
import templates from "./templates.json";

/** A machine to begin with: blocks that are attached to the starting block, one after the other. */
export interface Template {
  name: string;
  about: string;
  /** What names of tasks that it is for begin with. */
  families: readonly string[];
  /** On which block, and on which of its faces, each block is attached. */
  blocks: readonly (readonly string[])[];
}

export const TEMPLATES: readonly Template[] = templates;
const BLOCK = "Small Wooden Block";

/** The machines to begin a task with. */
export function templatesFor(task: string): Template[] {
  const family = task.replace(/-\d+$/, "");
  return TEMPLATES.filter(({ families }) => families.includes(family));
}

/** A template as calls of a session. */
export function callsOf({ blocks }: Template): Call[] {
  return [
    { tool: "start", arguments: {} },
    ...blocks.map(([base, face]): Call => ({
      tool: "attach_block_to",
      arguments: { base_block: base, face, new_block: BLOCK },
    })),
  ];
}

/** Makes calls in a session that is empty; what is refused there is left out. */
export async function make(calls: readonly (Call & { machine?: string })[], session: string): Promise<void> {
  for (const { machine = MAIN, ...call } of calls) {
    await taken(
      client.POST("/v1/sessions/{session_id}/calls", {
        params: { path: { session_id: session } },
        body: { ...call, machine },
      }),
    );
  }
}
