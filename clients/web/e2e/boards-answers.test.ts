import type { Browser } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import type { components } from "../src/api/contract";
import { ask, expectNoSeriousFault, launched, textsOf, URL_OF_SERVICE, visit, type Visit } from "./browser";

type Schemas = components["schemas"];

let browser: Browser;

function opened(path: string): Promise<Visit> {
  return visit(browser, path, {});
}

beforeAll(async () => {
  browser = await launched();
});
afterAll(() => browser.close());

describe("failures", () => {
  it("open from a bar, are summed by reason, narrowed down and sorted", async () => {
    const { page, context } = await opened("/");
    const bar = page.locator(".plot a[aria-label*='failed']").first();
    const told = /: (\d+) /.exec((await bar.getAttribute("aria-label")) ?? "")?.[1];
    await bar.scrollIntoViewIfNeeded();
    await bar.click();
    await page.waitForURL(/\/jobs\?/);
    const summary = page.getByRole("region", { name: "How these jobs ended" });
    await summary.getByText(`${told ?? ""} job`).waitFor();
    await page.goto(`${URL_OF_SERVICE}/jobs`);
    await summary.getByRole("link", { name: /^success/ }).click();
    await page.waitForURL(/outcome=success/);
    const wanted = await ask<Schemas["JobList"]>("/v1/jobs?outcome=success&sort=indicator&order=desc&state=done");
    await page.getByRole("button", { name: "Indicator" }).click();
    await page.waitForURL(/sort=indicator/);
    const first = wanted.data[0]?.id.slice(0, 12) ?? "none";
    await expect.poll(() => page.locator("tbody tr").first().textContent()).toContain(first);
    await page.getByRole("button", { name: "More filters" }).click();
    await page.getByLabel("Contains").fill("said by nobody");
    await page.keyboard.press("Enter");
    await page.getByText("No job is like that").waitFor();
    expect(page.url()).toContain("text=said");
    await context.close();
  });

  it("are found by what was said, in the turn that said it", async () => {
    const { page, context } = await opened("/jobs");
    await page.getByLabel("Said in transcripts").fill("block");
    await page.keyboard.press("Enter");
    const hit = page.locator("article.turn").first();
    const [, turn] = /turn (\d+)/.exec((await hit.getByRole("link").textContent()) ?? "") ?? [];
    expect(await hit.locator("mark").count()).toBeGreaterThan(0);
    await hit.getByRole("link").click();
    await page.locator(`article[data-turn="${turn ?? ""}"][data-chosen]`).waitFor();
    await context.close();
  });

  it("have what roles were told, which their turns say when they are asked", async () => {
    const { data: matches } = await ask<Schemas["TranscriptMatchList"]>(
      "/v1/transcripts?text=drawing",
    );
    const id = matches[0]?.job_id ?? "";
    const { page, context } = await opened(`/jobs/${id}?turn=${matches[0]?.turn ?? ""}`);
    const told = page.locator("article[data-chosen] details.told");
    await told.waitFor();
    const [first] = (await ask<Schemas["PromptList"]>(`/v1/jobs/${id}/prompts`)).data;
    expect(await told.locator("pre").first().isVisible()).toBe(false);
    await told.locator("summary").click();
    expect(await told.locator("pre").allTextContents()).toEqual([first?.system, ...(first?.user ?? [])]);
    await expectNoSeriousFault(page);
    await context.close();
  });
});

it("two rows of the board are compared in two ticks and a click, in the board's scope", async () => {
  const scope = encodeURIComponent('["support"]');
  const { page, context } = await opened(`/?category=${scope}`);
  await page.getByLabel("Compare builtin/expert").check();
  await page.getByText("Tick a second model").waitFor();
  await page.getByLabel("Compare builtin/idle").check();
  await page.getByRole("link", { name: "Compare builtin/expert and builtin/idle" }).click();
  await page.waitForURL(/\/compare\?/);
  expect(decodeURIComponent(page.url())).toContain("support");
  const found = await ask<Schemas["Comparison"]>(
    "/v1/leaderboard/compare?first=builtin/expert&second=builtin/idle&category=support",
  );
  await page.getByText("First minus second").waitFor();
  const shown = await textsOf(page, "div[aria-label='Both models task by task, scrolls'] table");
  expect(shown.map(([task]) => task)).toEqual(found.tasks.map(({ task }) => task));
  expect(await page.getByRole("status").first().textContent()).toContain("builtin/expert");
  expect(await page.getByLabel("Second model").first().inputValue()).toBe("builtin/idle");
  expect(await page.getByLabel("Tasks", { exact: true }).first().inputValue()).toBe("Bridges");
  await context.close();
});

it("what is not there has a way on, and the places leave room on a phone", async () => {
  const { page, context } = await opened("/tasks");
  await page.goto(`${URL_OF_SERVICE}/jobs/job_0`);
  await page.getByRole("alert").getByRole("link", { name: "all jobs" }).click();
  await page.getByRole("heading", { name: "Jobs", level: 1 }).waitFor();
  await page.setViewportSize({ width: 390, height: 844 });
  const header = await page.locator("header").first().boundingBox();
  expect(header?.height ?? Infinity).toBeLessThan(110);
  expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(390);
  await context.close();
});

it("the method is a click away from the board, with the versions in use", async () => {
  const { page, context } = await opened("/");
  await page.getByRole("link", { name: "Method", exact: true }).click();
  await page.getByRole("heading", { name: "What is not claimed" }).waitFor();
  const used = await ask<Schemas["Versions"]>("/v1/versions");
  const shown = await textsOf(page, 'table[aria-label="Versions in use"]');
  const simulators = used.simulators.map(({ name, version }) => [`Simulator ${name}`, version]);
  expect(shown.map((cells) => cells.at(-1))).toEqual([
    used.buildarena,
    used.feedback,
    String(used.scorers),
    ...simulators.map((cells) => cells[1]),
  ]);
  await context.close();
});
