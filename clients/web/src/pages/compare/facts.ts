import type { JobDetail } from "../../api/queries";
import { count, dollars, duration, number, secondsBetween, words } from "../../format";

export interface Fact {
  name: string;
  a: string;
  b: string;
}

function told(job: JobDetail): [string, string][] {
  return [
    ["Outcome", words(job.outcome ?? job.state)],
    ["Reason", job.reason === null ? "–" : words(job.reason)],
    ["Indicator", `${job.censored ? "≥ " : ""}${number(job.indicator)}`],
    ["Flags", (job.flags ?? []).map(words).join(", ") || "–"],
    ["Actions", count(job.actions)],
    ["Refused actions", count(job.refused_actions)],
    ["Model requests", count(job.usage.requests)],
    ["Tokens in", count(job.usage.input_tokens)],
    ["Tokens out", count(job.usage.output_tokens)],
    ["Cost", dollars(job.usage.cost_usd)],
    ["Took", duration(secondsBetween(job.started_at, job.finished_at))],
    ["Track", job.track],
    ...Object.entries(job.metrics ?? {}).flatMap(([name, value]): [string, string][] =>
      typeof value === "number"
        ? [[words(name), number(value, Number.isInteger(value) ? 0 : 2)]]
        : typeof value === "boolean"
          ? [[words(name), value ? "yes" : "no"]]
          : [],
    ),
  ];
}

/** What is told of two jobs, fact by fact; "–" where one has no such fact. */
export function factsOf(first: JobDetail, second: JobDetail): Fact[] {
  const [a, b] = [new Map(told(first)), new Map(told(second))];
  return [...new Set([...a.keys(), ...b.keys()])].map((name) => ({
    name,
    a: a.get(name) ?? "–",
    b: b.get(name) ?? "–",
  }));
}
