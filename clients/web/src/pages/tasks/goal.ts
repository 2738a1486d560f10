const GOAL = /\*\*Goal\.\*\*\s*([\s\S]*?)(?:\n\n|$)/;

/** The paragraph that says what is to be built, or the statement's beginning. */
export function goalOf(statement: string): string {
  return (GOAL.exec(statement)?.[1] ?? statement).replaceAll(/\s+/g, " ").trim();
}
