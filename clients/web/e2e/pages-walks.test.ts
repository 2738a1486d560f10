import type { Browser } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import type { components } from "../src/api/contract";
import {
  act,
  ask,
  expectNoSeriousFault,
  launched,
  openSession,
  recolour,
  settled,
  URL_OF_SERVICE,
  visit,
} from "./browser";
import { expectNumbers, numbersOf } from "./numbers";
import { expectAllReached } from "./walking";

type Schemas = components["schemas"];

let browser: Browser;
const ids = { sweep: "", second: "", job: "", other: "", session: "" };

beforeAll(async () => {
  browser = await launched();
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
afterAll(() => browser.close());

const PAGES: readonly (readonly [string, () => string])[] = [
  ["board", () => "/"],
  ["sweeps", () => "/sweeps"],
  ["sweep", () => `/sweeps/${ids.sweep}`],
  ["new sweep", () => "/sweeps/new"],
  ["jobs", () => "/jobs"],
  ["job", () => `/jobs/${ids.job}`],
  ["trial", () => `/jobs/${ids.job}?view=trial`],
  ["frame of a trial", () => `/embed/job/${ids.job}`],
  ["two jobs", () => `/compare?a=${ids.job}&b=${ids.other}`],
  ["two models", () => "/compare?models=builtin%2Fexpert,builtin%2Fidle"],
  ["tasks", () => "/tasks"],
  ["task", () => "/tasks/support-1"],
  ["model", () => "/models/builtin/expert"],
  ["method", () => "/method"],
  ["beginning of building", () => "/build"],
  ["build room", () => `/build?session=${ids.session}`],
  ["address that nobody has", () => "/nowhere"],
];

describe.each(PAGES)("the page: %s", (name, path) => {
  it("has no serious fault in either mode and size, and every control is reached by the keyboard", async () => {
    const { page, context, faults } = await visit(browser, path());
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
    expect(name === "address that nobody has" ? [] : faults).toEqual([]);
    await context.close();
  });
});

it("ten numbers of a page are the service's on two tracks", async () => {
  const ended = async (): Promise<boolean> => {
    const { progress } = await ask<Schemas["Sweep"]>(`/v1/sweeps/${ids.second}`);
    return progress.done === progress.total;
  };
  await expect.poll(ended, { timeout: 45_000, interval: 500 }).toBe(true);
  const { data: jobs } = await ask<Schemas["JobList"]>("/v1/jobs?model=builtin/expert&outcome=success");
  const tracks = [...new Set(jobs.map((job) => job.track))];
  expect(tracks.length).toBeGreaterThanOrEqual(2);
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 } });
  const page = await context.newPage();
  for (const track of tracks.slice(0, 2)) {
    for (const numbers of await numbersOf(track, ask)) {
      await page.goto(URL_OF_SERVICE + numbers.path);
      await settled(page);
      await expectNumbers(page, numbers);
    }
  }
  await context.close();
}, 120_000);
