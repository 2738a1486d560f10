import { queryOptions } from "@tanstack/react-query";
import { bytesOf, jsonOf, type Schema } from "../../api/client";
import type { JobDetail } from "../../api/queries";
import { ApiError } from "../../api/problem";
import type { MachineScene } from "../../scene/machine";
import type { Scenario } from "../../scene/Surroundings";
import type { Replay } from "./replay";
import type { Transcript } from "./transcript";

const path = (id: string, rest: string): string => `/v1/jobs/${encodeURIComponent(id)}/${rest}`;

/** A job that has not begun has nothing yet, which is not an error. */
async function ifAny<Data>(asked: Promise<Data>): Promise<Data | null> {
  try {
    return await asked;
  } catch (error) {
    if (error instanceof ApiError && error.status === 404) return null;
    throw error;
  }
}

export const transcript = (id: string) =>
  queryOptions({
    queryKey: ["job", id, "transcript"],
    staleTime: Infinity,
    queryFn: () => ifAny(jsonOf<Transcript>(path(id, "transcript"))),
  });

/** What each role was given before its turns; null where it was not kept. */
export const prompts = (id: string) =>
  queryOptions({
    queryKey: ["job", id, "prompts"],
    staleTime: Infinity,
    queryFn: async () => (await ifAny(jsonOf<Schema<"PromptList">>(path(id, "prompts"))))?.data ?? null,
  });

export const replay = (id: string) =>
  queryOptions({
    queryKey: ["job", id, "replay"],
    staleTime: Infinity,
    queryFn: () => ifAny(jsonOf<Replay>(path(id, "replay"))),
  });

export interface Scene {
  scenario: Scenario;
  machine: MachineScene | null;
}

export const scene = (id: string, number: number) =>
  queryOptions({
    queryKey: ["job", id, "scene", number],
    staleTime: Infinity,
    queryFn: async (): Promise<Scene> => {
      const found = await jsonOf<Schema<"Scene">>(path(id, `scene?number=${number}`));
      return { scenario: found.scenario as unknown as Scenario, machine: found.machine };
    },
  });

export const trial = (id: string, number: number, hash: string | undefined) =>
  queryOptions({
    queryKey: ["trial", hash],
    enabled: hash !== undefined,
    staleTime: Infinity,
    queryFn: async () => {
      const { ARROW, readTrial } = await import("../../scene/trial");
      return readTrial(await bytesOf(path(id, `trajectory?number=${number}`), ARROW));
    },
  });

/** The numbers of a job's trials that left a trajectory: those that score it first, then test trials. */
export function rolloutsOf({ artifacts, worlds }: Pick<JobDetail, "artifacts" | "worlds">): number[] {
  const kept = Object.keys(artifacts)
    .flatMap((name) => /^trajectory-(\d+)$/.exec(name)?.[1] ?? [])
    .map(Number)
    .sort((a, b) => a - b);
  const scored = worlds.map((world) => world.rollout).filter((number) => kept.includes(number));
  return [...scored, ...kept.filter((number) => !scored.includes(number))];
}
