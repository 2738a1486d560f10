import { listed, summed, type Categories, type Rows } from "./site-jobs";
import { ApiError } from "./problem";
import { SITE, type Site } from "./site";

const JOB = /^\/v1\/jobs\/([^/]+)/;
/** Nobody may change anything here, so no page offers it. */
const READER = { key_id: null, scopes: ["read"], keys_required: false };
/** Statuses of what a site does not hold, or can't do. */
export const NOT_KEPT: ReadonlySet<number> = new Set([405, 410]);
const WORDS: Readonly<Record<string, string>> = {
  "/v1/leaderboard": "It holds its boards as a whole and task by task; other choices need a running service.",
  "/v1/leaderboard/export": "It holds exports of its boards as a whole and task by task.",
  "/v1/leaderboard/compare": "It holds comparisons of models as the boards name them, on the tracks that they share.",
};

/** Path and parameters as a site's index has them: decoded, and the parameters in order. */
export function keyOf(url: URL): string {
  const words = [...url.searchParams].map(([name, value]) => `${name}=${value}`).sort();
  return decodeURIComponent(url.pathname) + (words.length > 0 ? `?${words.join("&")}` : "");
}

async function file(name: string, cache: RequestCache = "default"): Promise<Response> {
  try {
    const response = await fetch(new URL(name, document.baseURI), { cache });
    if (response.ok) return response;
  } catch {
    // Reported below, as an answer that is not a file.
  }
  throw new ApiError(
    0,
    null,
    "a file of this site can’t be read: perhaps it was written again meanwhile, and reloading the page helps",
  );
}

const read = new Map<string, Promise<unknown>>();

/** A JSON file that several answers are made of, read once. */
function once<Data>(name: string, cache: RequestCache = "default"): Promise<Data> {
  const known = read.get(name);
  if (known !== undefined) return known as Promise<Data>;
  const reading = file(name, cache).then((response) => response.json() as Promise<Data>);
  read.set(name, reading);
  reading.catch(() => read.delete(name));
  return reading;
}

export const readSite = (): Promise<Site> => once<Site>(SITE ?? "", "no-cache");

function problem(status: number, title: string, detail: string): Response {
  return Response.json({ type: "about:blank", status, code: "path_not_found", title, detail, errors: [] }, { status });
}

function found(name: string | null | undefined, why: string): Promise<Response> | Response {
  if (name === null) return problem(404, "Not found", "The service had none when this site was written.");
  return name === undefined ? problem(410, "Not on this site", why) : file(name);
}

async function ofJob(id: string, key: string): Promise<Response> {
  const site = await readSite();
  const rows = await once<Rows>(site.jobs);
  if (!rows.kept.includes(id)) {
    const known = rows.jobs.some((job) => job.id === id);
    const why = known ? "of this job only its result, which lists and boards show" : "no such job";
    return problem(410, "Not on this site", `This site holds ${why}.`);
  }
  const files = await once<{ answers: Record<string, string | null> }>(`jobs/${id}.json`, "no-cache");
  return found(files.answers[key], "This file of the job was left out of this site.");
}

const LISTS: Readonly<Record<string, typeof listed | typeof summed>> = {
  "/v1/jobs": listed,
  "/v1/jobs/summary": summed,
};

async function categoriesOf(site: Site): Promise<Categories> {
  const name = site.answers["/v1/tasks"];
  const tasks = name == null ? [] : (await once<{ data: { name: string; category: string }[] }>(name)).data;
  const found = new Map<string, Set<string>>();
  for (const task of tasks) found.set(task.category, (found.get(task.category) ?? new Set()).add(task.name));
  return found;
}

/** Answers a request from a site's files, as the service would. */
export async function keptAnswer(request: Request): Promise<Response> {
  if (request.method !== "GET")
    return problem(
      405,
      "Not on this site",
      "This is a published copy: nothing can be changed here. A running service can.",
    );
  const url = new URL(request.url);
  if (url.pathname === "/v1/caller") return Response.json(READER);
  const site = await readSite();
  const kept = LISTS[url.pathname];
  if (kept !== undefined) {
    const categories = url.searchParams.has("category") ? await categoriesOf(site) : undefined;
    return Response.json(kept(await once<Rows>(site.jobs), url.searchParams, categories));
  }
  const key = keyOf(url);
  const job = JOB.exec(url.pathname)?.[1];
  if (job !== undefined) return ofJob(decodeURIComponent(job), key);
  return found(site.answers[key], `This site does not hold that. ${WORDS[url.pathname] ?? site.holds}`);
}
