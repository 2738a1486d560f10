import type { Browser, Locator, Page } from "playwright-core";
import { afterAll, beforeAll, expect, it } from "vitest";
import type { components } from "../src/api/contract";
import { ask, launched, settled, type Visit, visit } from "./browser";

// The questions that people open the pages with, and in how many clicks from the front page they are
// answered.

type Schemas = components["schemas"];

let browser: Browser;
beforeAll(async () => {
  browser = await launched();
});
afterAll(() => browser.close());

/** A page, and a click that counts. */
async function asked(path: string): Promise<Visit & { click: (what: Locator) => Promise<void>; clicks: () => number }> {
  const seen = await visit(browser, path);
  await seen.context.grantPermissions(["clipboard-read", "clipboard-write"]);
  let clicks = 0;
  const click = async (what: Locator): Promise<void> => {
    clicks += 1;
    await what.click();
  };
  return { ...seen, click, clicks: () => clicks };
}

it("who is best at bridges, and is it real? In two clicks", async () => {
  const { page, context, click, clicks } = await asked("/");
  await click(page.getByText("Bridges", { exact: true }));
  await page.getByRole("heading", { level: 1, name: "Leaderboard: Bridges" }).waitFor();
  const board = await ask<Schemas["Board"]>("/v1/leaderboard?category=support");
  const said = page.getByRole("status").filter({ hasText: board.verdict?.sentence ?? "nothing" });
  await said.first().waitFor();
  await click(page.getByRole("link", { name: "How ranks and intervals come about" }));
  await page.getByRole("heading", { level: 1, name: "Method" }).waitFor();
  expect(clicks()).toBeLessThanOrEqual(2);
  await context.close();
});

it("why did this model fail at that task? In two clicks", async () => {
  const { page, context, click, clicks } = await asked("/");
  await click(page.locator("a.heat-cell[title^='builtin/idle on support-1:']"));
  await page.getByRole("region", { name: /jobs, scrolls/ }).waitFor();
  await click(page.locator("main a[href*='/jobs/job_']").first());
  await page.waitForURL(/\/jobs\/job_/);
  await settled(page);
  const id = /job_[0-9a-f]+/.exec(page.url())?.[0] ?? "";
  const job = await ask<Schemas["JobDetail"]>(`/v1/jobs/${id}`);
  expect([job.model, job.task]).toEqual(["builtin/idle", "support-1"]);
  await page
    .getByText(job.detail ?? "no detail")
    .first()
    .waitFor();
  expect(clicks()).toBeLessThanOrEqual(2);
  await context.close();
});

it("look at this moment of the trial! In one click", async () => {
  const { data: jobs } = await ask<Schemas["JobList"]>("/v1/jobs?model=builtin/expert&outcome=success&limit=1");
  const path = `/jobs/${jobs[0]?.id ?? ""}?view=trial`;
  const { page, context, click, clicks } = await asked(path);
  await page.getByRole("slider").first().press("End");
  const shown = await time(page);
  await click(page.getByRole("button", { name: "Copy link to this moment" }));
  await page.getByText("The link is copied.").waitFor();
  expect(clicks()).toBe(1);
  await page.goto(await page.evaluate(() => navigator.clipboard.readText()));
  await settled(page);
  await expect.poll(() => time(page)).toBe(shown);
  await context.close();
});

const time = (page: Page): Promise<string | null> => page.getByText(/^\d+\.\d \/ \d+ s$/).textContent();

it("which of two models is better? In two clicks", async () => {
  const { page, context, click, clicks } = await asked("/");
  await click(page.getByLabel("Compare builtin/idle"));
  await click(page.getByRole("link", { name: "Compare builtin/idle and builtin/expert" }));
  await page.getByText("First minus second").waitFor();
  expect(await page.getByRole("status").first().textContent()).toContain("builtin/");
  expect(clicks()).toBeLessThanOrEqual(2);
  await context.close();
});
