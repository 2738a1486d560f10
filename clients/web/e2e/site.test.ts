import type { Page } from "playwright-core";
import { beforeAll, describe, expect, it } from "vitest";
import type { components } from "../src/api/contract";
import { listed, type Rows } from "../src/api/site-jobs";
import type { Site } from "../src/api/site";
import { ALL_LOOKS, expectNoSeriousFault, URL_OF_SERVICE, browser } from "./browser";
import { expectNumbers, numbersOf } from "./numbers";

type JobPage = components["schemas"]["JobList"];

/** Published sites under a sub-path of a file server: one with every job whole, one with the best alone. */
const [WHOLE = "", BEST = ""] = (process.env.BUILDARENA_WEB_SITES ?? "").split(",");
const CANVAS_MS = 20_000;

let site: Site;
let rows: Rows;
let built = "";
let failed = "";

async function file<Data>(base: string, name: string): Promise<Data> {
  return (await (await fetch(base + name)).json()) as Data;
}

async function asked<Data>(path: string): Promise<Data> {
  return (await (await fetch(URL_OF_SERVICE + path)).json()) as Data;
}

/** Opens a page of a site, and lets no request leave it; `faults` is what it should not have done. */
async function opened(base: string, path: string, width = 1280): Promise<{ page: Page; faults: string[] }> {
  const context = await browser.newContext({
    viewport: { width, height: 900 },
    colorScheme: width < 800 ? "dark" : "light",
    reducedMotion: "reduce",
  });
  const page = await context.newPage();
  const faults: string[] = [];
  await page.route("**/*", (route) => {
    const url = route.request().url();
    if (url.startsWith(base)) return route.continue();
    faults.push(`left the site: ${url}`);
    return route.abort();
  });
  page.on("pageerror", (error) => faults.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") faults.push(message.text());
  });
  page.on("response", (response) => {
    if (response.status() >= 400) faults.push(`${response.status()} ${response.url()}`);
  });
  await page.goto(`${base}#${path}`);
  await page.locator("footer").waitFor();
  await page.waitForFunction(() => document.querySelector("[aria-busy=true]") === null);
  return { page, faults };
}

describe.skipIf(WHOLE === "")("a published site", () => {
  beforeAll(async () => {
    site = await file<Site>(WHOLE, "site.json");
    rows = await file<Rows>(WHOLE, site.jobs);
    built = rows.jobs.find((job) => job.outcome === "success" && job.task === "support-1")?.id ?? "";
    failed = rows.jobs.find((job) => job.outcome !== "success" && job.task === "support-1")?.id ?? "";
  });

  const PAGES: readonly (readonly [string, number, () => string])[] = [
    ["the board", 1280, () => "/"],
    ["the board", 390, () => "/?baselines=no"],
    ["a sweep", 390, () => `/sweeps/${site.sweeps[0] ?? ""}`],
    ["the sweeps", 1280, () => "/sweeps"],
    ["the jobs", 390, () => "/jobs"],
    ["a job", 1280, () => `/jobs/${built}`],
    ["a build", 390, () => `/jobs/${built}?view=building`],
    ["two jobs", 1280, () => `/compare?a=${built}&b=${failed}`],
    ["two models", 390, () => "/compare?models=builtin%2Fexpert,builtin%2Fidle"],
    ["the tasks", 390, () => "/tasks"],
    ["a task", 1280, () => "/tasks/support-1"],
    ["a model", 1280, () => "/models/builtin/expert"],
    ["what is not there", 390, () => "/jobs/job_none"],
    ["a new sweep", 1280, () => "/sweeps/new"],
  ];

  it.each(PAGES.filter((_, index) => ALL_LOOKS || index % 2 === 0))(
    "shows %s at %d px without a fault, from its own files",
    async (_, width, path) => {
      const { page, faults } = await opened(WHOLE, path(), width);
      await expectNoSeriousFault(page);
      expect(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth)).toBe(true);
      expect(await page.getByRole("alert").filter({ hasText: "Try again" }).count()).toBe(0);
      expect(faults).toEqual([]);
      for (const name of ["Verify", "Give an API key", "Start the sweep", "Pause", "Cancel…"])
        expect(await page.getByRole("button", { name }).count(), name).toBe(0);
      await page.context().close();
    },
  );

  it("has the numbers of each page as the service has them", async () => {
    const track = rows.jobs.find((job) => job.id === built)?.track ?? "";
    for (const numbers of await numbersOf(track, asked)) {
      const { page } = await opened(WHOLE, numbers.path);
      await expectNumbers(page, numbers);
      await page.context().close();
    }
  });

  it("leads from the board to a machine that builds itself and a trial that plays", async () => {
    const { page, faults } = await opened(WHOLE, "/");
    await page.getByText("More: success on each task").click();
    await page.locator("a.heat-cell").first().click();
    await page
      .getByRole("region", { name: /jobs?, scrolls/ })
      .getByRole("link")
      .first()
      .click();
    await page.locator("canvas").waitFor({ timeout: CANVAS_MS });
    const time = page.getByText(/^\d+\.\d \/ \d+ s$/);
    const before = await time.textContent();
    await page.getByRole("button", { name: "Play" }).click();
    await expect.poll(() => time.textContent(), { timeout: CANVAS_MS }).not.toBe(before);
    const address = page.url();
    expect(address).toMatch(/#\/jobs\/job_/);
    expect(faults).toEqual([]);
    // The address of a view is good for whoever it is sent to.
    await page.reload();
    await page.locator("canvas").waitFor({ timeout: CANVAS_MS });
    expect(page.url()).toBe(address);
    await page.getByRole("tab", { name: "Building" }).click();
    await page.getByRole("button", { name: "First step" }).click();
    await expect.poll(() => page.locator("[data-step]").getAttribute("data-step")).toBe("0");
    expect(faults).toEqual([]);
    await page.context().close();
  });

  it("gives files to keep", async () => {
    const { page, faults } = await opened(WHOLE, `/jobs/${built}?view=files`);
    for (const [button, ending] of [
      ["Save machine.glb", ".glb"],
      ["Save machine", ".json"],
    ] as const) {
      const waiting = page.waitForEvent("download");
      await page.getByRole("button", { name: button, exact: true }).click();
      expect((await waiting).suggestedFilename()).toContain(ending);
    }
    await page.goto(`${WHOLE}#/`);
    for (const [format, ending] of [
      ["CSV", "csv"],
      ["Parquet", "parquet"],
      ["LaTeX table", "tex"],
      ["JSON", "json"],
    ] as const) {
      await page.getByRole("button", { name: "Download" }).click();
      const waiting = page.waitForEvent("download");
      await page.getByRole("menuitem", { name: format, exact: true }).click();
      expect((await waiting).suggestedFilename()).toBe(`leaderboard.${ending}`);
    }
    expect(faults).toEqual([]);
    await page.context().close();
  });

  it("keeps what its switches lead to, and says what it lacks", async () => {
    const { page, faults } = await opened(WHOLE, "/?task=support-1&baselines=no");
    // Every model of this site is a baseline.
    await page.getByRole("button", { name: "Filters" }).click();
    await page.getByRole("switch", { name: "Baselines" }).click({ force: true });
    await page.waitForFunction(() => !location.hash.includes("baselines"));
    await page.getByRole("table", { name: "Overall" }).getByText("builtin/expert").waitFor();
    await page.goto(`${WHOLE}#/?task=${encodeURIComponent('["support-1","lift-1"]')}`);
    await page.getByText("other choices need a running service").waitFor();
    await page.goto(`${WHOLE}#/compare?models=no%2Fone,builtin%2Fidle`);
    await page.getByText("It holds comparisons of models").waitFor();
    expect(faults).toEqual([]);
    await page.context().close();
  });

  it("moves to its content by the keyboard, and stays on its page", async () => {
    const { page } = await opened(WHOLE, "/tasks");
    await page.keyboard.press("Tab");
    await page.keyboard.press("Enter");
    expect(await page.evaluate(() => document.activeElement?.id)).toBe("main");
    expect(page.url()).toBe(`${WHOLE}#/tasks`);
    await page.context().close();
  });

  it("with the best jobs alone says so of the others", async () => {
    const best = await file<Site>(BEST, "site.json");
    const { kept, jobs } = await file<Rows>(BEST, best.jobs);
    expect(kept.length).toBeLessThan(jobs.length);
    const other = jobs.find((job) => !kept.includes(job.id))?.id ?? "";
    const { page, faults } = await opened(BEST, `/jobs/${other}`);
    await page.getByText("of this job only its result").waitFor();
    expect(await page.locator("footer").textContent()).toContain("only the results are included");
    await page.goto(`${BEST}#/jobs/${kept[0] ?? ""}`);
    await page.getByRole("tab", { name: "Transcript" }).waitFor();
    expect(faults).toEqual([]);
    await page.context().close();
  });

  it("filters and sorts jobs as the service does", async () => {
    const sorts = ["created", "finished", "indicator", "cost"];
    const [one] = rows.jobs;
    const filters: Record<string, string>[] = [
      {},
      { task: "support-1" },
      { model: "builtin/random" },
      { outcome: "success" },
      { state: "done" },
      { state: "running" },
      { text: "SUPPORT" },
      { text: "unreadable" },
      { configuration: one?.configuration ?? "" },
      { task_version: one?.task_version ?? "" },
    ];
    for (const sweep of site.sweeps) {
      const queries: Record<string, string>[] = [
        ...filters.map((filter) => ({ ...filter, sweep })),
        ...sorts.flatMap((sort) => ["asc", "desc"].map((order) => ({ sort, order, sweep }))),
      ];
      for (const query of queries) {
        const words = new URLSearchParams(query);
        const wanted = await asked<JobPage>(`/v1/jobs?limit=200&${words.toString()}`);
        const found = listed(rows, new URLSearchParams([...words, ["limit", "200"]]));
        expect(found.data, words.toString()).toEqual(wanted.data);
      }
    }
    const pages: string[] = [];
    for (let cursor: string | null = "0"; cursor !== null;) {
      const page: JobPage = listed(rows, new URLSearchParams({ limit: "4", cursor, sort: "indicator" }));
      pages.push(...page.data.map((job) => job.id));
      cursor = page.next_cursor;
    }
    expect(pages).toEqual(
      listed(rows, new URLSearchParams({ limit: "1000", sort: "indicator" })).data.map((job) => job.id),
    );
  });
});
