import { keepPreviousData, queryOptions } from "@tanstack/react-query";
import type { BoardSearch } from "./board-search";
import { client, taken, type Schema } from "./client";
import type { paths } from "./contract";
import { readSite } from "./site-cache";
import { every, isSite } from "./site";

export type Board = Schema<"Board">;
export type Caller = Schema<"Caller">;
export type SweepFault = Schema<"SweepFault">;
export type Row = Schema<"BoardRow">;
export type TaskBoard = Schema<"TaskBoard">;
export type OverallRow = Schema<"OverallRow">;
export type Sweep = Schema<"Sweep">;
export type Forecast = Schema<"Forecast">;
export type JobSummary = Schema<"JobSummary">;
export type Job = Schema<"Job">;
export type JobDetail = Schema<"JobDetail">;
export type Task = Schema<"Task">;
export type TaskDetail = Schema<"TaskDetail">;
type JobQuery = NonNullable<paths["/v1/jobs"]["get"]["parameters"]["query"]>;
/** Pages narrow lists down by one value of each kind, and by several categories. */
export type JobFilters = {
  [Name in keyof JobQuery]: Name extends "category"
    ? JobQuery[Name]
    : NonNullable<JobQuery[Name]> extends (infer One)[]
      ? One
      : JobQuery[Name];
};
export const asQuery = (filters: JobFilters): JobQuery => filters as JobQuery;

/** The rows of a list that one page holds. */
const rowsOf = async <Row>(asked: Promise<{ data: Row[] }>): Promise<Row[]> => (await asked).data;

const LIVE_MS = 5_000;

/** What a board counts: what its address says, or the jobs of a sweep. */
type Counted = BoardSearch & { sweep?: string };

export function boardQuery(search: Counted): Record<string, string | string[]> {
  const query: Record<string, string | string[]> = {};
  if (search.track !== undefined) query.track = search.track;
  if (search.task !== undefined && search.task.length > 0) query.task = search.task;
  if (search.category !== undefined && search.category.length > 0) query.category = search.category;
  if (search.sweep !== undefined) query.sweep = search.sweep;
  return query;
}

export const board = (search: Counted) =>
  queryOptions({
    queryKey: ["board", boardQuery(search)],
    queryFn: () => taken(client.GET("/v1/leaderboard", { params: { query: boardQuery(search) } })),
    placeholderData: keepPreviousData,
    refetchInterval: every(4 * LIVE_MS),
  });

/** What a published site says of itself. */
export const site = () => queryOptions({ queryKey: ["site"], enabled: isSite, staleTime: Infinity, queryFn: readSite });

/** Who the service takes this tab for. */
export const caller = () =>
  queryOptions({
    queryKey: ["caller"],
    staleTime: 60_000,
    queryFn: () => taken(client.GET("/v1/caller", {})),
  });

/** What results depend on besides model and task. */
export const versions = () =>
  queryOptions({
    queryKey: ["versions"],
    staleTime: 60_000,
    queryFn: () => taken(client.GET("/v1/versions", {})),
  });

export const sweeps = (cursor?: string) =>
  queryOptions({
    queryKey: ["sweeps", cursor ?? ""],
    queryFn: () => taken(client.GET("/v1/sweeps", { params: { query: { limit: 50, cursor } } })),
    placeholderData: keepPreviousData,
    refetchInterval: every(LIVE_MS),
  });

export const sweep = (id: string) =>
  queryOptions({
    queryKey: ["sweep", id],
    queryFn: () => taken(client.GET("/v1/sweeps/{sweep_id}", { params: { path: { sweep_id: id } } })),
  });

/** When a sweep ends and what it comes to cost, as the service foretells it. */
export const sweepForecast = (id: string) =>
  queryOptions({
    queryKey: ["sweep-forecast", id],
    queryFn: () => taken(client.GET("/v1/sweeps/{sweep_id}/forecast", { params: { path: { sweep_id: id } } })),
    refetchInterval: every(2 * LIVE_MS),
  });

export const sweepFaults = (id: string) =>
  queryOptions({
    queryKey: ["sweep-faults", id],
    refetchInterval: every(2 * LIVE_MS),
    queryFn: () => rowsOf(taken(client.GET("/v1/sweeps/{sweep_id}/faults", { params: { path: { sweep_id: id } } }))),
  });

/** What a list of jobs comes to. */
export const jobSummary = (filters: JobFilters) =>
  queryOptions({
    queryKey: ["job-summary", filters],
    queryFn: () => taken(client.GET("/v1/jobs/summary", { params: { query: asQuery(filters) } })),
    placeholderData: keepPreviousData,
    refetchInterval: every(2 * LIVE_MS),
  });

/** The first jobs of a list. */
export const someJobs = (filters: JobFilters) =>
  queryOptions({
    queryKey: ["some-jobs", filters],
    queryFn: () => rowsOf(taken(client.GET("/v1/jobs", { params: { query: asQuery(filters) } }))),
  });

/** Jobs of one page, as many as the service gives. */
export const PAGE = 200;

export const jobPage = (filters: JobFilters) =>
  taken(client.GET("/v1/jobs", { params: { query: { ...asQuery(filters), limit: PAGE } } }));

/** Jobs page after page, as they are asked for. */
export async function* jobPages(filters: JobFilters): AsyncGenerator<readonly Job[]> {
  let cursor: string | undefined;
  do {
    const page = await jobPage({ ...filters, cursor });
    yield page.data;
    cursor = page.next_cursor ?? undefined;
  } while (cursor !== undefined);
}

export const job = (id: string) =>
  queryOptions({
    queryKey: ["job", id],
    queryFn: () => taken(client.GET("/v1/jobs/{job_id}", { params: { path: { job_id: id } } })),
  });

/** A job, asked for each second until it has ended. */
export const jobUntilDone = (id: string) => ({
  ...job(id),
  refetchInterval: (asked: { state: { data?: JobDetail } }) => (asked.state.data?.state === "done" ? false : 1_000),
});

export const jobFiles = (id: string) =>
  queryOptions({
    queryKey: ["job-files", id],
    queryFn: () => rowsOf(taken(client.GET("/v1/jobs/{job_id}/artifacts", { params: { path: { job_id: id } } }))),
  });

export const tasks = () =>
  queryOptions({
    queryKey: ["tasks"],
    staleTime: 60_000,
    queryFn: () => rowsOf(taken(client.GET("/v1/tasks", {}))),
  });

export const task = (name: string, version?: string) =>
  queryOptions({
    queryKey: ["task", name, version ?? ""],
    staleTime: 60_000,
    queryFn: () => taken(client.GET("/v1/tasks/{task}", { params: { path: { task: name }, query: { version } } })),
  });

export const models = () =>
  queryOptions({
    queryKey: ["models"],
    staleTime: 60_000,
    queryFn: () => rowsOf(taken(client.GET("/v1/models", {}))),
  });

export const simulators = () =>
  queryOptions({
    queryKey: ["simulators"],
    staleTime: 60_000,
    queryFn: () => rowsOf(taken(client.GET("/v1/simulators", {}))),
  });
