import type { Page } from "playwright-core";
import { describe, expect, it } from "vitest";
import type { components } from "../src/api/contract";
import { ask, asked, expectClicks, expectNoSeriousFault, settled, textsOf, visit } from "./browser";

type Schemas = components["schemas"];

/** No worker of the tests' service runs this simulator, so its jobs wait once they are built. */
const WAITING = { tasks: ["support-1"], models: ["builtin/expert"], simulator: "pybullet" };

const time = (page: Page): Promise<string | null> => page.getByText(/^\d+\.\d \/ \d+ s$/).textContent();

describe("questions from the front page", () => {
  it("who is best at bridges? In one click; whether it is real, in another", async () => {
    const { page, context, click, clicks } = await asked("/");
    const since = Date.now();
    await click(page.getByText("Bridges", { exact: true }));
    await page.waitForURL(/category=/);
    await page.getByRole("heading", { level: 1, name: "Leaderboard: Bridges" }).waitFor();
    const board = await ask<Schemas["Board"]>("/v1/leaderboard?category=support");
    await page
      .getByRole("status")
      .filter({ hasText: board.verdict?.sentence ?? "nothing" })
      .first()
      .waitFor();
    expectClicks("best at bridges", clicks(), 1, since);
    await click(page.getByRole("main").getByRole("link", { name: "Method" }));
    await page.getByRole("heading", { level: 1, name: "Method" }).waitFor();
    await context.close();
  });

  it("why did this model fail? In two clicks", async () => {
    const { page, context, click, clicks } = await asked("/");
    const since = Date.now();
    const board = await ask<Schemas["Board"]>("/v1/leaderboard");
    const row = board.overall.find(({ model }) => model === "builtin/idle");
    await click(page.getByRole("link", { name: /^Runs of builtin\/idle/ }));
    await page.getByRole("region", { name: new RegExp(`^${row?.counted ?? 0} jobs?, scrolls`) }).waitFor();
    await click(page.locator("main a[href*='/jobs/job_']").first());
    await page.waitForURL(/\/jobs\/job_/);
    await settled(page);
    const id = /job_[0-9a-f]+/.exec(page.url())?.[0] ?? "";
    const job = await ask<Schemas["JobDetail"]>(`/v1/jobs/${id}`);
    expect(job.model).toBe("builtin/idle");
    await page
      .getByText(job.explanation ?? "no sentence")
      .first()
      .waitFor();
    expectClicks("why it failed", clicks(), 2, since);
    await context.close();
  });

  it("on which task does it fail? A cell opens exactly its jobs", async () => {
    const { page, context } = await visit("/");
    const board = await ask<Schemas["Board"]>("/v1/leaderboard");
    const row = board.tasks[0]?.rows.find(({ model }) => model === "builtin/idle");
    await page.getByText("More: success on each task").click();
    await page.locator("a.heat-cell[title^='builtin/idle on support-1:']").click();
    await page.getByRole("region", { name: new RegExp(`^${row?.ended ?? 0} jobs?, scrolls`) }).waitFor();
    await context.close();
  });

  it("share the moment a bridge breaks! In two clicks", async () => {
    const { data: jobs } = await ask<Schemas["JobList"]>("/v1/jobs?model=builtin/expert&outcome=success&limit=1");
    const { page, context, click, clicks } = await asked(`/jobs/${jobs[0]?.id ?? ""}`);
    const since = Date.now();
    const started = await time(page);
    await click(page.getByRole("button", { name: /^✕ .* at \d/ }).first());
    await expect.poll(() => time(page)).not.toBe(started);
    const shown = await time(page);
    await click(page.getByRole("button", { name: "Share" }));
    await page.getByText("The link is copied").waitFor();
    expectClicks("share the break", clicks(), 2, since);
    await page.goto(await page.evaluate(() => navigator.clipboard.readText()));
    await settled(page);
    await expect.poll(() => time(page)).toBe(shown);
    await page.getByRole("tab", { name: "Building" }).click();
    await page.getByRole("button", { name: "Build it step by step" }).waitFor();
    await context.close();
  });

  it("start a sweep of a known model! With three fields", async () => {
    const { page, context } = await visit("/sweeps/new");
    expect(await page.getByRole("main").locator("input:visible").count()).toBe(3);
    await page.getByRole("status", { name: "Estimate" }).waitFor();
    await expect.poll(() => page.getByRole("button", { name: "Start the sweep" }).isEnabled()).toBe(true);
    await context.close();
  });

  it("what did it do? The scored trial plays by itself, once, under a line for each world", async () => {
    const { data: jobs } = await ask<Schemas["JobList"]>("/v1/jobs?model=builtin/expert&outcome=success&limit=1");
    const { page, context } = await visit(`/jobs/${jobs[0]?.id ?? ""}`, { motion: true });
    await page.getByRole("button", { name: "Play" }).waitFor({ timeout: 60_000 });
    expect(await time(page)).not.toMatch(/^0\.0/);
    const job = await ask<Schemas["JobDetail"]>(`/v1/jobs/${jobs[0]?.id ?? ""}`);
    expect(await page.getByRole("list", { name: "Scored trials" }).getByRole("listitem").count()).toBe(
      job.worlds.length > 1 ? job.worlds.length : 0,
    );
    await context.close();
  });

  it("which of two models is better? In a click, in the board's scope", async () => {
    const { page, context } = await asked(`/?category=${encodeURIComponent('["support"]')}`);
    await page.getByRole("link", { name: "Compare models" }).click();
    await page.waitForURL(/\/compare\?/);
    const models = (new URL(page.url()).searchParams.get("models") ?? "").split(",");
    const found = await ask<Schemas["Comparison"]>(
      `/v1/leaderboard/compare?first=${models[0] ?? ""}&second=${models[1] ?? ""}&category=support`,
    );
    await page.getByText("First minus second").waitFor();
    const shown = await textsOf(page, "div[aria-label='Both models task by task, scrolls'] table");
    expect(shown.map(([task]) => task)).toEqual(found.tasks.map(({ task }) => task));
    expect(await page.getByRole("status").first().textContent()).toContain("builtin/");
    expect(await page.getByLabel("Tasks", { exact: true }).first().inputValue()).toBe("Bridges");
    await context.close();
  });
});

it("filters are in the address, and are read from it", async () => {
  const { page, context } = await visit("/");
  const baselines = page.getByRole("switch", { name: "Baselines" });
  await page.getByRole("button", { name: "Filters" }).click();
  await expectNoSeriousFault(page);
  await baselines.click({ force: true });
  await page.waitForURL(/baselines=no/);
  await page.reload();
  await page.getByRole("button", { name: "Filters" }).click();
  expect(await baselines.isChecked()).toBe(false);
  await context.close();
});

describe("jobs", () => {
  it("are summed by reason, narrowed down and sorted", async () => {
    const { page, context } = await visit("/jobs");
    const summary = page.getByRole("region", { name: "How these jobs ended" });
    await summary.getByRole("link", { name: /^succeeded/ }).click();
    await page.waitForURL(/outcome=success/);
    const wanted = await ask<Schemas["JobList"]>("/v1/jobs?outcome=success&sort=indicator&order=desc&state=done");
    await page.getByRole("button", { name: "Result" }).click();
    await page.waitForURL(/sort=indicator/);
    const first = wanted.data[0]?.id.slice(0, 12) ?? "none";
    await expect.poll(() => page.locator("tbody tr").first().textContent()).toContain(first);
    await page.getByLabel("Contains").fill("never said");
    await page.keyboard.press("Enter");
    await page.getByText("No job is like that").waitFor();
    expect(page.url()).toContain("text=never+said");
    await context.close();
  });

  it("are found by what was said, in the turn that said it, with what the role was given", async () => {
    const { page, context } = await visit("/jobs");
    await page.getByLabel("Said in transcripts").fill("drawing");
    await page.keyboard.press("Enter");
    const hit = page.locator("article.turn").first();
    await hit.locator("mark").first().waitFor();
    await hit.getByRole("link").click();
    const turn = page.locator("article[data-chosen]");
    await turn.waitFor();
    const id = /job_[0-9a-f]+/.exec(page.url())?.[0] ?? "";
    const { data: prompts } = await ask<Schemas["PromptList"]>(`/v1/jobs/${id}/prompts`);
    const prompt = prompts.find((one) => one.turn === Number(new URL(page.url()).searchParams.get("turn")));
    await turn.locator("details.prompt summary").click();
    expect(await turn.locator("pre.prompt-text").allTextContents()).toEqual([prompt?.system, ...(prompt?.user ?? [])]);
    await context.close();
  });
});

describe("sweeps", () => {
  it("are submitted once, however often the button is clicked, and not with a fault", async () => {
    const before = (await ask<Schemas["SweepList"]>("/v1/sweeps?limit=100")).data.length;
    const { page, context } = await visit("/sweeps/new");
    const button = page.getByRole("button", { name: "Start the sweep" });
    const models = page.getByRole("combobox", { name: "Models" }).or(page.getByLabel("Models")).first();
    await models.fill("builtin/idel");
    await models.press("Enter");
    await page
      .getByText(/choose from.*builtin\/idle/)
      .first()
      .waitFor();
    expect(await button.isEnabled()).toBe(false);
    await models.press("Backspace");
    await page.getByRole("heading", { name: "New sweep" }).click();
    await page.getByText("More", { exact: true }).click();
    await page.getByLabel("Name", { exact: true }).fill("clicked twice");
    await expect.poll(() => button.isEnabled(), { timeout: 10_000 }).toBe(true);
    await expectNoSeriousFault(page);
    await button.evaluate((found: HTMLButtonElement) => {
      found.click();
      found.click();
    });
    await page.waitForURL(/\/sweeps\/sweep_/);
    const after = (await ask<Schemas["SweepList"]>("/v1/sweeps?limit=100")).data;
    expect(after.length).toBe(before + 1);
    expect(after[0]?.spec.simulator).toBe("pybullet");
    await context.close();
  });

  it("change on the page as they change in the service", async () => {
    const { id } = await ask<Schemas["SweepAccepted"]>("/v1/sweeps", {
      ...WAITING,
      name: "watched",
      seeds: [101, 102],
    });
    const { page, context } = await visit(`/sweeps/${id}`);
    await page.getByText("live", { exact: true }).waitFor();
    const jobs = await ask<Schemas["JobList"]>(`/v1/jobs?sweep=${id}`);
    await ask(`/v1/jobs/${jobs.data[0]?.id ?? ""}/cancel`, {});
    await expect.poll(() => page.getByRole("link", { name: /^cancelled 1 / }).count(), { timeout: 10_000 }).toBe(1);
    await page.getByRole("button", { name: "Pause" }).click();
    await page.getByRole("button", { name: "Resume" }).waitFor();
    expect((await ask<Schemas["Sweep"]>(`/v1/sweeps/${id}`)).state).toBe("paused");
    await page.getByText(/^1 on hold before/).waitFor();
    await page.getByRole("button", { name: "Budget…" }).click();
    await page.getByLabel("US dollars").fill("12.5");
    await page.getByRole("button", { name: "Set the budget" }).click();
    await page.getByText("of $12.50").waitFor();
    const raised = await ask<Schemas["Sweep"]>(`/v1/sweeps/${id}`);
    expect([raised.state, raised.budget?.max_cost_usd, raised.budget?.max_requests]).toEqual(["paused", 12.5, null]);
    await page.getByRole("button", { name: "Cancel…" }).click();
    await page.getByRole("button", { name: "Cancel the sweep" }).click();
    await expect.poll(() => page.getByRole("link", { name: /^cancelled 2 / }).count(), { timeout: 10_000 }).toBe(1);
    await expect.poll(() => page.getByText("live", { exact: true }).count(), { timeout: 10_000 }).toBe(0);
    await context.close();
  });
});
