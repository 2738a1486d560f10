import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import type { components } from "../src/api/contract";
import { act, ask, expectNoSeriousFault, launched, openSession, settled, URL_OF_SERVICE, visit } from "./browser";
import { expectNumbers, numbersOf } from "./numbers";

type Schemas = components["schemas"];

/** Presses that a page may take beyond its controls: the frame's own, and what takes two. */
const SPARE = 20;
/** Colours fade from one mode to the other. */
const FADE_MS = 250;

let browser: Browser;
const ids = { sweep: "", second: "", job: "", other: "", session: "" };

beforeAll(async () => {
  browser = await launched();
  const { jobs } = await ask<Schemas["JobPage"]>("/v1/jobs?model=builtin/expert&outcome=success");
  ids.job = jobs[0]?.id ?? "";
  ids.other = (await ask<Schemas["JobPage"]>("/v1/jobs?model=builtin/idle")).jobs[0]?.id ?? "";
  ids.sweep = (await ask<Schemas["SweepPage"]>("/v1/sweeps")).sweeps[0]?.id ?? "";
  // Another track: the same models in another workflow.
  const again = { tasks: ["support-1"], models: ["builtin/expert", "builtin/idle"], seeds: [0], simulator: "mujoco" };
  const sent = { ...again, name: "second track", workflow: "builder" };
  ids.second = (await ask<Schemas["SweepAccepted"]>("/v1/sweeps", sent)).id;
  ids.session = await openSession("walker", 77, { kind: "human" });
  await act(ids.session, "start", {});
});
afterAll(() => browser.close());

const PAGES: readonly (readonly [string, () => string])[] = [
  ["board", () => "/?paper=yes"],
  ["sweeps", () => "/sweeps"],
  ["sweep", () => `/sweeps/${ids.sweep}`],
  ["new sweep", () => "/sweeps/new"],
  ["two sweeps", () => "/sweeps/compare"],
  ["jobs", () => "/jobs"],
  ["transcripts", () => "/transcripts?text=block&of=prompts"],
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
  ["machines", () => "/machine"],
  ["beginning of driving", () => "/drive"],
  ["drive room", () => `/drive?job=${ids.job}`],
  ["challenges", () => "/challenges"],
  ["address that nobody has", () => "/nowhere"],
];

/** Marks what a person can press, type into or open, and counts it. */
function markControls(page: Page): Promise<number> {
  return page.evaluate(() => {
    const kinds = "a[href], button, input, select, textarea, summary, [tabindex], [contenteditable=true]";
    const controls = [...document.querySelectorAll<HTMLElement>(kinds)].filter((found) => {
      const off = found.matches(":disabled, [tabindex='-1'], [type=hidden], [aria-hidden=true], [aria-hidden=true] *");
      if (off || !found.checkVisibility({ visibilityProperty: true })) return false;
      if (!(found instanceof HTMLInputElement) || found.type !== "radio") return true;
      // Of radio buttons Tab reaches the chosen one, and the arrows the others.
      const group = document.querySelectorAll<HTMLInputElement>(`input[type=radio][name="${found.name}"]`);
      return found.checked || ![...group].some((one) => one.checked);
    });
    for (const control of controls) control.dataset.walk = "wanted";
    document.addEventListener("focusin", ({ target }) => {
      if (target instanceof HTMLElement) target.dataset.walk = "reached";
    });
    (document.activeElement as HTMLElement | null)?.blur();
    return controls.length;
  });
}

function missed(page: Page): Promise<string[]> {
  return page.evaluate(() =>
    [...document.querySelectorAll('[data-walk="wanted"]')].map((control) => control.outerHTML.slice(0, 160)),
  );
}

describe.each(PAGES)("the page: %s", (name, path) => {
  it("has no serious fault in either mode and size, and every control is reached by the keyboard", async () => {
    const { page, context, faults } = await visit(browser, path());
    await page.waitForTimeout(300);
    const controls = await markControls(page);
    for (let presses = 0; presses < controls + SPARE; presses += 1) {
      await page.keyboard.press("Tab");
      if (presses >= controls - 1 && (await missed(page)).length === 0) break;
    }
    expect(await missed(page), name).toEqual([]);
    for (const width of [1280, 390]) {
      await page.setViewportSize({ width, height: 900 });
      for (const colorScheme of ["light", "dark"] as const) {
        await page.emulateMedia({ colorScheme });
        await page.waitForTimeout(FADE_MS);
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
    const { progress } = await ask<Schemas["SweepView"]>(`/v1/sweeps/${ids.second}`);
    return progress.done === progress.total;
  };
  await expect.poll(ended, { timeout: 45_000, interval: 500 }).toBe(true);
  const { jobs } = await ask<Schemas["JobPage"]>("/v1/jobs?model=builtin/expert&outcome=success");
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
