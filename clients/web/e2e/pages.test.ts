import { beforeAll, describe, expect, it } from "vitest";
import type { components } from "../src/api/contract";
import {
  act,
  ask,
  expectNoSeriousFault,
  openSession,
  recolour,
  settled,
  URL_OF_SERVICE,
  visit,
  browser,
} from "./browser";
import { expectNumbers, numbersOf } from "./numbers";
import { expectAllReached } from "./walking";

type Schemas = components["schemas"];

const ids = { sweep: "", second: "", job: "", other: "", session: "" };

beforeAll(async () => {
  const { data: jobs } = await ask<Schemas["JobList"]>("/v1/jobs?model=builtin/expert&outcome=success");
  ids.job = jobs[0]?.id ?? "";
  ids.other = (await ask<Schemas["JobList"]>("/v1/jobs?model=builtin/idle")).data[0]?.id ?? "";
  ids.sweep = (await ask<Schemas["SweepList"]>("/v1/sweeps")).data[0]?.id ?? "";
  // Another track: the same models in another workflow.
  const again = { tasks: ["support-1"], models: ["builtin/expert", "builtin/idle"], seeds: [0], simulator: "mujoco" };
  const sent = { ...again, name: "second track", workflow: "builder" };
  ids.second = (await ask<Schemas["SweepAccepted"]>("/v1/sweeps", sent)).id;
  ids.session = await openSession("walker", 77, { kind: "human" });
  await act(ids.session, "start", {});
});

const PAGES: readonly (readonly [string, () => string])[] = [
  ["board", () => "/"],
  ["sweeps", () => "/sweeps"],
  ["sweep", () => `/sweeps/${ids.sweep}`],
  ["new sweep", () => "/sweeps/new"],
  ["jobs", () => "/jobs"],
  ["job", () => `/jobs/${ids.job}`],
  ["building of a job", () => `/jobs/${ids.job}?view=building`],
  ["measurements of a job", () => `/jobs/${ids.job}?view=measurements`],
  ["two jobs", () => `/compare?a=${ids.job}&b=${ids.other}`],
  ["two models", () => "/compare?models=builtin%2Fexpert,builtin%2Fidle"],
  ["tasks", () => "/tasks"],
  ["task", () => "/tasks/support-1"],
  ["model", () => "/models/builtin/expert"],
  ["method", () => "/method"],
  ["beginning of building", () => "/build"],
  ["build room", () => `/build?session=${ids.session}`],
  ["unknown address", () => "/nowhere"],
];

describe.each(PAGES)("the page: %s", (name, path) => {
  it("has no serious fault in either mode and size, and every control is reached by the keyboard", async () => {
    const { page, context, faults } = await visit(path());
    await page.waitForTimeout(300);
    await expectAllReached(page);
    for (const width of [1280, 390]) {
      await page.setViewportSize({ width, height: 900 });
      for (const colorScheme of ["light", "dark"] as const) {
        await recolour(page, colorScheme);
        await expectNoSeriousFault(page);
      }
      expect(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${width}`).toBe(true);
    }
    expect(name === "unknown address" ? [] : faults).toEqual([]);
    await context.close();
  });
});

it("numbers of a page are the service's on two tracks", async () => {
  const ended = async (): Promise<boolean> => {
    const { progress } = await ask<Schemas["Sweep"]>(`/v1/sweeps/${ids.second}`);
    return progress.done === progress.total;
  };
  await expect.poll(ended, { timeout: 45_000, interval: 500 }).toBe(true);
  const { data: jobs } = await ask<Schemas["JobList"]>("/v1/jobs?model=builtin/expert&outcome=success");
  const tracks = [...new Set(jobs.map((job) => job.track))];
  expect(tracks.length).toBeGreaterThanOrEqual(2);
  const { page, context } = await visit("/");
  for (const track of tracks.slice(0, 2)) {
    for (const numbers of await numbersOf(track, ask)) {
      await page.goto(URL_OF_SERVICE + numbers.path);
      await settled(page);
      await expectNumbers(page, numbers);
    }
  }
  await context.close();
}, 120_000);

it("loads at most 350 kB of script on the first page, and no 3D; its table begins near the top", async () => {
  const context = await browser.newContext({ viewport: { width: 1440, height: 900 } });
  const page = await context.newPage();
  const sizes: number[] = [];
  page.on("response", (response) => {
    if (response.url().endsWith(".js")) sizes.push(Number(response.headers()["content-length"] ?? 0));
  });
  await page.goto(URL_OF_SERVICE);
  const table = page.getByRole("table", { name: "Overall" });
  await table.waitFor();
  expect(sizes.reduce((sum, size) => sum + size, 0)).toBeLessThan(350_000);
  expect((await table.boundingBox())?.y ?? Infinity).toBeLessThanOrEqual(220);
  await context.close();
});

it("what is missing is said in words and has a link on, and the places leave room on a phone", async () => {
  const { page, context } = await visit("/tasks");
  await page.goto(`${URL_OF_SERVICE}/jobs/job_0`);
  const alert = page.getByRole("alert").filter({ hasText: "Not found" });
  await alert.getByRole("link", { name: "all jobs" }).click();
  await page.getByRole("heading", { name: "Jobs", level: 1 }).waitFor();
  await page.setViewportSize({ width: 390, height: 844 });
  const header = await page.locator("header").first().boundingBox();
  expect(header?.height ?? Infinity).toBeLessThan(110);
  await context.close();
});
