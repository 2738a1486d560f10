import { keepPreviousData, queryOptions } from "@tanstack/react-query";
import type { BoardSearch } from "./board-search";
import { client, taken, type Schema } from "./client";
import type { paths } from "./contract";
import { readSite } from "./kept";
import { every, isSite } from "./site";

export type Board = Schema<"Board">;
export type Figures = Schema<"Figures">;
export type Caller = Schema<"CallerView">;
export type Trouble = Schema<"TroubleView">;
export type Row = Schema<"Row">;
export type TaskBoard = Schema<"TaskBoard">;
export type OverallView = Schema<"OverallView">;
export type SweepView = Schema<"SweepView">;
export type Forecast = Schema<"ForecastView">;
export type JobSummary = Schema<"JobSummaryView">;
export type JobView = Schema<"JobView">;
export type JobDetail = Schema<"JobDetail">;
export type TaskView = Schema<"TaskView">;
export type TaskDetail = Schema<"TaskDetail">;
export type JobFilters = NonNullable<paths["/v1/jobs"]["get"]["parameters"]["query"]>;

const LIVE_MS = 5_000;

export function boardQuery(search: BoardSearch): Record<string, string | string[]> {
  const query: Record<string, string | string[]> = {};
  if (search.track !== undefined) query.track = search.track;
  if (search.task !== undefined && search.task.length > 0) query.task = search.task;
  if (search.category !== undefined && search.category.length > 0) query.category = search.category;
  return query;
}

export const board = (search: BoardSearch) =>
  queryOptions({
    queryKey: ["board", boardQuery(search)],
    queryFn: () => taken(client.GET("/v1/leaderboard", { params: { query: boardQuery(search) } })),
    placeholderData: keepPreviousData,
    refetchInterval: every(4 * LIVE_MS),
  });

/** What the board's drawings are made of: the same that reports are drawn from. */
export const figures = (search: BoardSearch) =>
  queryOptions({
    queryKey: ["figures", boardQuery(search)],
    queryFn: () => taken(client.GET("/v1/leaderboard/figures", { params: { query: boardQuery(search) } })),
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

export const sweepTroubles = (id: string) =>
  queryOptions({
    queryKey: ["sweep-troubles", id],
    refetchInterval: every(2 * LIVE_MS),
    queryFn: () => taken(client.GET("/v1/sweeps/{sweep_id}/troubles", { params: { path: { sweep_id: id } } })),
  });

/** Jobs that faults ended: they are in no average until they are retried. */
export const deadLetters = (id: string) =>
  queryOptions({
    queryKey: ["sweep-jobs", id, "errored"],
    refetchInterval: every(3 * LIVE_MS),
    queryFn: () =>
      taken(
        client.GET("/v1/jobs", { params: { query: { sweep: id, outcome: "errored", sort: "finished", limit: 100 } } }),
      ),
  });

/** What a list of jobs comes to. */
export const jobSummary = (filters: JobFilters) =>
  queryOptions({
    queryKey: ["job-summary", filters],
    queryFn: () => taken(client.GET("/v1/jobs/summary", { params: { query: filters } })),
    placeholderData: keepPreviousData,
    refetchInterval: every(2 * LIVE_MS),
  });

/** Jobs of one page, as many as the service gives. */
export const PAGE = 200;

export const jobPage = (filters: JobFilters) =>
  taken(client.GET("/v1/jobs", { params: { query: { ...filters, limit: PAGE } } }));

/** Jobs page after page, as they are asked for. */
export async function* jobPages(filters: JobFilters): AsyncGenerator<readonly JobView[]> {
  let cursor: string | undefined;
  do {
    const page = await jobPage({ ...filters, cursor });
    yield page.jobs;
    cursor = page.next_cursor ?? undefined;
  } while (cursor !== undefined);
}

export const job = (id: string) =>
  queryOptions({
    queryKey: ["job", id],
    queryFn: () => taken(client.GET("/v1/jobs/{job_id}", { params: { path: { job_id: id } } })),
  });

export const jobFiles = (id: string) =>
  queryOptions({
    queryKey: ["job-files", id],
    queryFn: () => taken(client.GET("/v1/jobs/{job_id}/artifacts", { params: { path: { job_id: id } } })),
  });

export const tasks = () =>
  queryOptions({
    queryKey: ["tasks"],
    staleTime: 60_000,
    queryFn: () => taken(client.GET("/v1/tasks", {})),
  });

export const task = (name: string, version?: string) =>
  queryOptions({
    queryKey: ["task", name, version ?? ""],
    staleTime: 60_000,
    queryFn: () => taken(client.GET("/v1/tasks/{name}", { params: { path: { name }, query: { version } } })),
  });

export const models = () =>
  queryOptions({
    queryKey: ["models"],
    staleTime: 60_000,
    queryFn: () => taken(client.GET("/v1/models", {})),
  });

export const simulators = () =>
  queryOptions({
    queryKey: ["simulators"],
    staleTime: 60_000,
    queryFn: () => taken(client.GET("/v1/simulators", {})),
  });
