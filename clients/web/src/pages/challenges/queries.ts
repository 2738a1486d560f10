import { queryOptions, useMutation, useQueryClient } from "@tanstack/react-query";
import { client, jsonOf, sentFile, taken, type Schema } from "../../api/client";

export type SeasonView = Awaited<ReturnType<typeof askedFor>>;
export type Season = SeasonView["season"];
export type Ranked = Schema<"Ranked">;
export type PackageView = Schema<"PackageView">;
export type PackageDetail = Schema<"PackageDetail">;

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
const ZIP = "application/zip";

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

const ofPackage = (id: string) => ({ params: { path: { package: id } } });

export const entry = (id: string) =>
  queryOptions({
    queryKey: ["packages", id],
    queryFn: () => taken(client.GET("/v1/submissions/{package}", ofPackage(id))),
  });

/** What a package looks like; it never changes once it was checked. */
export const entryPicture = (id: string) =>
  queryOptions({
    queryKey: ["packages", id, "picture"],
    queryFn: () => jsonOf<Schema<"PackagePicture">>(`/v1/submissions/${encodeURIComponent(id)}/picture`),
    staleTime: Infinity,
  });

interface Entry {
  file: File;
  season: string;
  track: string;
}

/** What a season's checks say of a file that nobody hands in. */
export const useLook = () =>
  useMutation({
    mutationFn: ({ file, ...query }: Entry) =>
      sentFile<Schema<"PackageReport">>("/v1/submissions/check", { ...query }, file, ZIP),
  });

export const useHandIn = () => {
  const known = useQueryClient();
  return useMutation({
    mutationFn: ({ file, ...query }: Entry & { name: string }) =>
      sentFile<Schema<"ReceivedPackage">>("/v1/submissions", { ...query }, file, ZIP),
    onSuccess: (_, { season: name }) => known.invalidateQueries({ queryKey: ["seasons", name] }),
  });
};
