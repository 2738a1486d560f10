import type { Browser } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import { ALL_LOOKS, expectNoSeriousFault, launched, URL_OF_SERVICE, type Visit, visit } from "./browser";

let browser: Browser;
let sweep = "";
let built = "";

async function json(path: string): Promise<Record<string, { id: string }[]>> {
  return (await (await fetch(URL_OF_SERVICE + path)).json()) as Record<string, { id: string }[]>;
}

beforeAll(async () => {
  browser = await launched();
  sweep = (await json("/v1/sweeps")).data?.[0]?.id ?? "";
  built = (await json("/v1/jobs?model=builtin/expert&outcome=success")).data?.[0]?.id ?? "";
});
afterAll(() => browser.close());

function open(path: string, width = 1280, scheme: "light" | "dark" = "light"): Promise<Visit> {
  return visit(browser, path, { width, scheme });
}

const PAGES: readonly (readonly [string, () => string])[] = [
  ["leaderboard", () => "/"],
  ["method", () => "/method"],
  ["sweeps", () => "/sweeps"],
  ["sweep", () => `/sweeps/${sweep}`],
  ["jobs", () => "/jobs"],
  ["job", () => `/jobs/${built}`],
  ["trial", () => `/jobs/${built}?view=trial`],
  ["tasks", () => "/tasks"],
  ["task", () => "/tasks/support-1"],
  ["model", () => "/models/builtin/expert"],
];

const LOOKS = [
  [1280, "light"],
  [390, "dark"],
] as const;

// Every page in one look, alternately; in both in the nightly tests.
describe.each(PAGES.map((page, index) => [...page, index] as const))("the page of the %s", (_, path, index) => {
  it.each(LOOKS.filter((__, look) => ALL_LOOKS || look === index % 2))(
    "at %d px, %s, has no serious fault",
    async (width, scheme) => {
      const { page, faults, context } = await open(path(), width, scheme);
      await expectNoSeriousFault(page);
      expect(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth)).toBe(true);
      expect(faults).toEqual([]);
      await context.close();
    },
  );
});

describe("the leaderboard", () => {
  it("keeps its switches in the address, and reads them from it", async () => {
    const { page, context } = await open("/");
    await page.getByRole("switch", { name: "Baselines" }).click({ force: true });
    await page.waitForURL(/baselines=no/);
    await page.reload();
    await page.locator("h1").waitFor();
    expect(await page.getByRole("switch", { name: "Baselines" }).isChecked()).toBe(false);
    await context.close();
  });

  it("opens the jobs behind a cell", async () => {
    const { page, context } = await open("/");
    await page.locator("a.heat-cell").first().click();
    await page.waitForURL(/\/jobs\?.*task=/);
    await page.getByRole("region", { name: /jobs, scrolls/ }).waitFor();
    await context.close();
  });
});

it("leads in three clicks to a bridge that builds itself and breaks under its cargo", async () => {
  const { page, context } = await open("/");
  await page.locator("a.heat-cell").first().click();
  await page.waitForURL(/\/jobs\?.*task=/);
  await page.locator("main a[href*='/jobs/job_']").first().click();
  await page.getByRole("button", { name: "Build it step by step" }).click();
  const steps = Number(await page.locator("[data-steps]").getAttribute("data-steps"));
  await page.waitForFunction(() => Number(document.querySelector("[data-step]")?.getAttribute("data-step")) < 3);
  await page.waitForURL(/view=trial/, { timeout: 600 * steps + 10_000 });
  const time = page.getByText(/^\d+\.\d \/ \d+ s$/);
  await expect
    .poll(async () => Number.parseFloat((await time.textContent()) ?? ""), { timeout: 15_000 })
    .toBeGreaterThan(0);
  await page.getByText(/joints? broke/).waitFor();
  await context.close();
});

describe("a job", () => {
  it("draws its machine and plays its trial", async () => {
    const { page, context } = await open(`/jobs/${built}?view=trial`);
    const canvas = page.locator("canvas");
    await canvas.waitFor();
    const before = await page.getByText(/^\d+\.\d \/ \d+ s$/).textContent();
    await page.getByRole("button", { name: "Play" }).click();
    await expect.poll(() => page.getByText(/^\d+\.\d \/ \d+ s$/).textContent(), { timeout: 20_000 }).not.toBe(before);
    await context.close();
  });

  it("that nobody has is told in words", async () => {
    const context = await browser.newContext();
    const page = await context.newPage();
    await page.goto(`${URL_OF_SERVICE}/jobs/job_none`);
    await expect.poll(() => page.getByRole("alert").textContent()).toContain("There is no such thing");
    await context.close();
  });
});

it("loads at most 350 kB of script on the first page, and no 3D", async () => {
  const context = await browser.newContext();
  const page = await context.newPage();
  const sizes: number[] = [];
  page.on("response", (response) => {
    if (response.url().endsWith(".js")) sizes.push(Number(response.headers()["content-length"] ?? 0));
  });
  await page.goto(URL_OF_SERVICE);
  await page.locator("figure, .plot svg").first().waitFor();
  expect(sizes.reduce((sum, size) => sum + size, 0)).toBeLessThan(350_000);
  await context.close();
});
