import type { JobDetail } from "../../api/queries";
import { duration, secondsBetween } from "../../format";

/** How a run spent its time: "built in 9.0 s, simulated in 4.0 s, waited 7 min". */
export function timesOf({
  attempts,
  created_at,
  finished_at,
}: Pick<JobDetail, "attempts" | "created_at" | "finished_at">) {
  const spent = (stage: "construct" | "simulate"): number =>
    attempts
      .filter((attempt) => attempt.stage === stage)
      .reduce((sum, attempt) => sum + (secondsBetween(attempt.started_at, attempt.finished_at) ?? 0), 0);
  const [built, simulated] = [spent("construct"), spent("simulate")];
  const waited = (secondsBetween(created_at, finished_at) ?? 0) - built - simulated;
  const parts = [
    built > 0 && `built in ${duration(built)}`,
    simulated > 0 && `simulated in ${duration(simulated)}`,
    waited >= 1 && `waited ${duration(waited)}`,
  ];
  return parts.filter((part) => part !== false).join(", ");
}
