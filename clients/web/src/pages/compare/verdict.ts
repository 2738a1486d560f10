import type { Schema } from "../../api/client";

export type Comparison = Schema<"Comparison">;
type Task = Comparison["tasks"][number];

const ERROR = 0.05;

/** Which of two models is better on a task beyond chance: 1 the first, -1 the second, 0 when it is not shown. */
export function betterOn(task: Task): -1 | 0 | 1 {
  const claims = [
    { p: task.success_p, by: task.success?.difference ?? task.difference },
    { p: task.indicator_p, by: task.indicator?.difference ?? 0 },
  ].filter(({ p, by }) => p !== null && p <= ERROR && by !== 0);
  const signs = new Set(claims.map(({ by }) => Math.sign(by)));
  // Tests of success and indicator that point in opposite directions show neither to be better.
  if (signs.size !== 1) return 0;
  return signs.has(1) ? 1 : -1;
}

function on(tasks: readonly string[], of: number): string {
  if (tasks.length === of) return of === 1 ? `on ${tasks[0] ?? ""}` : `on all ${of} tasks`;
  return tasks.length <= 3 ? `on ${tasks.join(" and ")}` : `on ${tasks.length} of ${of} tasks`;
}

/** What a comparison comes to, in a sentence. */
export function verdictOf({ first, second, tasks }: Comparison): string {
  const better = (sign: number): string[] => tasks.filter((task) => betterOn(task) === sign).map((task) => task.task);
  const [ahead, behind] = [better(1), better(-1)];
  const open = tasks.length - ahead.length - behind.length;
  const claims = [
    ahead.length > 0 && `${first} is better ${on(ahead, tasks.length)}`,
    behind.length > 0 && `${second} is better ${on(behind, tasks.length)}`,
  ].filter((claim) => claim !== false);
  if (claims.length === 0)
    return `The shared seeds do not show that ${first} or ${second} is better ${tasks.length === 1 ? "on this task" : "on any task"}.`;
  const rest = open === 0 ? "" : `; on ${open === 1 ? "one other" : `${open} others`} the shared seeds show nothing`;
  return `${claims.join(", and ")}, beyond chance${rest}.`;
}
