import type { Browser, BrowserContext, Page } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import type { components } from "../src/api/contract";
import { ask, expectNoSeriousFault, launched, textsOf, URL_OF_SERVICE, type Visit, visit } from "./browser";
import { count, dollars, number, percent, places } from "../src/format";

type Schemas = components["schemas"];

const TASK = "support-1";
/** No worker of the tests' service runs this simulator, so its jobs wait once they are built. */
const WAITING = { tasks: [TASK], models: ["builtin/expert"], simulator: "pybullet" };

let browser: Browser;

function opened(path: string, url = URL_OF_SERVICE, width = 1280): Promise<Visit> {
  return visit(browser, path, { url, width, scheme: width < 800 ? "dark" : "light" });
}

beforeAll(async () => {
  browser = await launched();
});
afterAll(() => browser.close());

describe("every figure of the board", () => {
  let page: Page;
  let context: BrowserContext;
  let ofTask: Page;
  let beside: BrowserContext;
  let board: Schemas["Board"];
  let figures: Schemas["Figures"];
  beforeAll(async () => {
    ({ page, context } = await opened(`/?task=${TASK}`));
    board = await ask(`/v1/leaderboard?task=${TASK}`);
    figures = await ask(`/v1/leaderboard/figures?task=${TASK}`);
    for (const table of await page.getByText("As a table").all()) await table.click();
    ({ page: ofTask, context: beside } = await opened(`/tasks/${TASK}`));
  });
  afterAll(async () => {
    await context.close();
    await beside.close();
  });

  it("of the overall ranking is the service's", async () => {
    const shown = await textsOf(page, "section[aria-label=Overall] table");
    expect(shown).toHaveLength(board.overall.length);
    board.overall.forEach((row, index) => {
      const tied = board.overall.filter((other) => other.rank !== null && other.rank === row.rank).length > 1;
      const place = places(row.rank_low, row.rank_high);
      expect(shown[index]?.[0]).toContain(row.model);
      expect(shown[index]?.[0]?.includes("Pareto")).toBe(row.pareto);
      expect(shown[index]?.slice(1)).toEqual([
        `${row.rank ?? "–"}${tied ? "tied" : ""}`,
        place,
        number(row.mean_rank, 2),
        number(row.score_mean, 2),
        percent(row.success_rate_mean, 1),
        dollars(row.cost_usd_mean),
        count(row.output_tokens_mean),
        count(row.counted),
      ]);
    });
  });

  it("is summed up in one sentence on top, the service's", async () => {
    const said = page
      .getByRole("status")
      .filter({ hasText: board.verdict?.sentence ?? "nothing" })
      .first();
    expect(await said.textContent()).toContain(board.verdict?.sentence);
    const heading = await page.locator("section[aria-label=Overall]").boundingBox();
    expect((await said.boundingBox())?.y ?? Infinity).toBeLessThan(heading?.y ?? 0);
  });

  it("of each task is the service's", async () => {
    for (const task of board.tasks) {
      const shown = await textsOf(ofTask, `table[aria-label="Models on ${task.task}"]`);
      expect(shown).toHaveLength(task.rows.length);
      task.rows.forEach((row, index) => {
        const [model, rank, place, success, indicator, score, best, parts, cost, refused] = shown[index] ?? [];
        const atLeast = row.censored > 0 ? "≥ " : "";
        const spread =
          row.indicator_low === null
            ? row.too_few_data
              ? "too few data"
              : ""
            : `${number(row.indicator_low)} to ${number(row.indicator_high)}`;
        expect(model).toContain(row.model);
        expect(rank?.replace(" tied", "")).toBe(String(row.rank ?? "–"));
        expect(place).toBe(places(row.rank_low, row.rank_high));
        expect(success).toBe(
          `${percent(row.success_rate)} (${row.successes} of ${row.counted})${percent(row.success_low)} to ${percent(row.success_high)}`,
        );
        expect(indicator).toBe(`${row.indicator_mean === null ? "" : atLeast}${number(row.indicator_mean)}${spread}`);
        expect(score?.startsWith(number(row.score, 2))).toBe(true);
        expect(best).toBe(`${row.indicator_best === null ? "" : atLeast}${number(row.indicator_best)}`);
        expect([parts, cost, refused]).toEqual([
          count(row.parts_mean),
          dollars(row.cost_per_success_usd),
          percent(row.refused_action_rate),
        ]);
      });
    }
  });

  it("of the drawings is the service's", async () => {
    const front = await textsOf(page, 'table[aria-label="Cost and performance"]');
    expect(front).toEqual(
      figures.front.map((row) => [
        row.model,
        number(row.mean_rank, 2),
        percent(row.success_rate_mean, 1),
        dollars(row.cost_usd_mean),
        count(row.output_tokens_mean),
        row.pareto ? "yes" : "no",
      ]),
    );
    const ends = await textsOf(page, 'table[aria-label="How jobs end"]');
    expect(ends.map((row) => row.slice(0, 3).join(" ")).sort()).toEqual(
      figures.failures
        .flatMap((row) =>
          Object.entries(row.outcomes).map(([name, n]) => `${row.model} ${name.replaceAll("_", " ")} ${n}`),
        )
        .sort(),
    );
  });

  it("has a cell that opens exactly its jobs", async () => {
    const row = board.tasks[0]?.rows[0];
    await page.locator("a.heat-cell").first().click();
    await page.getByRole("region", { name: /jobs, scrolls/ }).waitFor();
    expect(await page.getByRole("region", { name: `${row?.ended ?? 0} jobs, scrolls` }).count()).toBe(1);
    await page.goBack();
  });
});

describe("what a board is about", () => {
  it("is chosen by a chip, stands in the address and in the title, and holds for the whole page", async () => {
    const { page, context } = await opened("/");
    await page.getByText("The paper’s nine", { exact: true }).waitFor();
    await page.getByText("Bridges", { exact: true }).click();
    await page.waitForURL(/category=/);
    await page.getByRole("heading", { level: 1, name: "Leaderboard: Bridges" }).waitFor();
    await page.getByText("Ranked over support-1.").waitFor();
    const rockets = await opened(`/?category=${encodeURIComponent('["lift"]')}`);
    await rockets.page.getByRole("heading", { level: 1, name: "Leaderboard: Rockets" }).waitFor();
    await rockets.page.getByText("No job of these tasks has ended on this track").waitFor();
    await expectNoSeriousFault(rockets.page);
    await rockets.context.close();
    // Somebody writes an address by hand.
    const plain = await opened("/?category=support");
    await plain.page.getByText("Ranked over support-1.").waitFor();
    await plain.context.close();
    await context.close();
  });
});

describe("sweeps", () => {
  it.each([
    ["/sweeps/new", 1280],
    ["/sweeps/new", 390],
    ["/tasks/lift-1", 390],
  ] as const)("%s at %d px has no serious fault", async (path, width) => {
    const { page, context } = await opened(path, URL_OF_SERVICE, width);
    if (path === "/sweeps/new") await page.getByText("YAML", { exact: true }).click();
    if (path === "/sweeps/new") await page.locator(".cm-content").waitFor();
    await expectNoSeriousFault(page);
    expect(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth)).toBe(true);
    await context.close();
  });

  it("are submitted once, however often the button is clicked", async () => {
    const before = (await ask<Schemas["SweepList"]>("/v1/sweeps?limit=100")).data.length;
    const { page, context } = await opened("/sweeps/new");
    await page
      .getByRole("textbox", { name: "Simulator" })
      .or(page.getByRole("combobox", { name: "Simulator" }))
      .first()
      .fill("pybullet");
    await page.getByLabel("Name", { exact: true }).fill("clicked twice");
    const button = page.getByRole("button", { name: "Submit the sweep" });
    await expect.poll(() => button.isEnabled(), { timeout: 10_000 }).toBe(true);
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

  it("have their faults at their lines, and none is sent with some", async () => {
    const { page, context } = await opened("/sweeps/new");
    await page.getByText("YAML", { exact: true }).click();
    const editor = page.locator(".cm-content");
    await editor.click();
    await page.keyboard.press("Control+a");
    await page.keyboard.insertText("name: x\ntasks: [support-1, suport-2]\nmodels: [builtin/idle]\nsamples: 2\n");
    const faults = page.getByRole("status").filter({ hasText: "One fault" });
    await faults.waitFor();
    expect(await faults.textContent()).toContain("line 2");
    expect(await faults.textContent()).toContain("support-3");
    expect(await page.getByRole("button", { name: "Submit the sweep" }).isEnabled()).toBe(false);
    expect(await page.locator(".cm-lintRange-error").textContent()).toBe("suport-2");
    await context.close();
  });

  it("change on the page as they change in the service", async () => {
    const { id } = await ask<Schemas["SweepAccepted"]>("/v1/sweeps", {
      ...WAITING,
      name: "watched",
      seeds: [101, 102],
    });
    const { page, context } = await opened(`/sweeps/${id}`);
    await page.getByText("live", { exact: true }).waitFor();
    const reads: string[] = [];
    page.on("request", (request) => {
      if (request.url().includes("order=asc")) reads.push(request.url());
    });
    const jobs = await ask<Schemas["JobList"]>(`/v1/jobs?sweep=${id}`);
    await ask(`/v1/jobs/${jobs.data[0]?.id ?? ""}/cancel`, {});
    await expect.poll(() => page.getByText("cancelled: 1").count(), { timeout: 10_000 }).toBe(1);
    expect(reads).toEqual([]);
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
    await expect.poll(() => page.getByText("cancelled: 2").count(), { timeout: 10_000 }).toBe(1);
    await context.close();
  });
});

it("a link on another site opens a page", async () => {
  const context = await browser.newContext();
  const page = await context.newPage();
  await page.route("http://elsewhere.example/", (route) =>
    route.fulfill({ contentType: "text/html", body: `<a href="${URL_OF_SERVICE}/tasks">here</a>` }),
  );
  await page.goto("http://elsewhere.example/");
  await page.getByText("here").click();
  await page.getByRole("heading", { name: "Tasks", level: 1 }).waitFor();
  await context.close();
});
