import { queryOptions, useMutation, useQueryClient } from "@tanstack/react-query";
import { client, taken, type Schema } from "../../api/client";
import { authorization } from "../../api/key";
import { ApiError, refusal } from "../../api/problem";
import { BASE } from "../../api/site";

export type SeasonView = Awaited<ReturnType<typeof askedFor>>;
export type Season = SeasonView["season"];
export type Ranked = Schema<"Ranked">;
export type PackageView = Schema<"PackageView">;

export interface Finding {
  check: string;
  passed: boolean;
  sentence: string;
}
export interface Term {
  name: string;
  points: number;
  share: number | null;
  sentence: string;
}
/** A season's word on a package; the contract leaves its form to the formula. */
export interface Report {
  findings: readonly Finding[];
  score: { terms: readonly Term[]; known: number; at_most: number; cost: number; unknown: readonly string[] } | null;
}

const EVERY_MS = 5000;

export const seasons = () => queryOptions({ queryKey: ["seasons"], queryFn: () => taken(client.GET("/v1/seasons")) });

const askedFor = (name: string) => taken(client.GET("/v1/seasons/{name}", { params: { path: { name } } }));

export const season = (name: string) => queryOptions({ queryKey: ["seasons", name], queryFn: () => askedFor(name) });

export const seasonBoard = (name: string, track: string) =>
  queryOptions({
    queryKey: ["seasons", name, "board", track],
    queryFn: () => taken(client.GET("/v1/seasons/{name}/board", { params: { path: { name }, query: { track } } })),
    refetchInterval: EVERY_MS,
  });

export const ownPackages = (name: string) =>
  queryOptions({
    queryKey: ["seasons", name, "own"],
    queryFn: () => taken(client.GET("/v1/submissions", { params: { query: { season: name, own: true } } })),
    refetchInterval: EVERY_MS,
  });

async function sent<Data>(path: string, query: Record<string, string>, file: Blob): Promise<Data> {
  let response: Response;
  try {
    response = await fetch(`${BASE}${path}?${new URLSearchParams(query).toString()}`, {
      method: "POST",
      body: file,
      headers: { ...authorization(), "Content-Type": "application/zip" },
    });
  } catch {
    throw new ApiError(0, null, "no answer came: is it running, and is the network there?");
  }
  const answer = (await response.json().catch(() => null)) as unknown;
  if (!response.ok) throw refusal(response.status, answer);
  return answer as Data;
}

interface Entry {
  file: File;
  season: string;
  track: string;
}

/** What a season's checks say of a file that nobody hands in. */
export const useLook = () =>
  useMutation({
    mutationFn: ({ file, ...query }: Entry) =>
      sent<Schema<"PackageReport">>("/v1/submissions/check", { ...query }, file),
  });

export const useHandIn = () => {
  const known = useQueryClient();
  return useMutation({
    mutationFn: ({ file, ...query }: Entry & { name: string }) =>
      sent<Schema<"ReceivedPackage">>("/v1/submissions", { ...query }, file),
    onSuccess: (_, { season: name }) => known.invalidateQueries({ queryKey: ["seasons", name] }),
  });
};
