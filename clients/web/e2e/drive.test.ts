import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, it } from "vitest";
import { ask, expectNoSeriousFault, launched, visit } from "./browser";

let browser: Browser;
/** A job with the expert's car. */
let built: string;

beforeAll(async () => {
  browser = await launched();
  const sweep = { tasks: ["transport-1"], models: ["builtin/expert"], seeds: [0], simulator: "mujoco" };
  const { id } = await ask<{ id: string }>("/v1/sweeps", sweep);
  for (built = ""; built === ""; await new Promise((resolve) => setTimeout(resolve, 200))) {
    const { jobs } = await ask<{ jobs: { id: string }[] }>(`/v1/jobs?sweep=${id}&state=done`);
    built = jobs[0]?.id ?? "";
  }
}, 70_000);
afterAll(() => browser.close());

async function seconds(page: Page): Promise<number> {
  const text = (await page.locator("p.figures").first().textContent()) ?? "";
  return Number.parseFloat(text);
}

it("drives a machine by keys, and tells when it is over", async () => {
  const { page, context, faults } = await visit(browser, `/drive?job=${built}`);
  await expectNoSeriousFault(page);
  await page.getByRole("combobox", { name: "Where" }).click();
  await page.getByRole("option", { name: /Free ground/ }).click();
  await page.getByRole("button", { name: "Begin" }).click();
  await page.getByText("Time begins with the first key.").waitFor();
  const canvas = page.locator("canvas");
  await canvas.waitFor();
  const still = await canvas.screenshot();
  await page.keyboard.down("ArrowUp");
  await page.locator(".drive-key[data-held=true]").first().waitFor();
  await expect.poll(() => seconds(page), { timeout: 10_000 }).toBeGreaterThan(1);
  await page.keyboard.up("ArrowUp");
  expect((await canvas.screenshot()).equals(still)).toBe(false);
  await expectNoSeriousFault(page);
  await page.getByRole("button", { name: "End the drive" }).click();
  await page.getByText(/It was practice/).waitFor();
  expect(faults).toEqual([]);
  await context.close();
});

it("stands under a name with the keys that were held, touched this time", async () => {
  const { page, context, faults } = await visit(browser, `/drive?job=${built}`, { width: 390 });
  await page.getByRole("textbox", { name: /Your name/ }).fill("ada-drives");
  await page.getByRole("button", { name: "Begin" }).click();
  const key = page.locator(".drive-key").first();
  await key.waitFor();
  await key.hover();
  await page.mouse.down();
  await expect.poll(() => seconds(page), { timeout: 10_000 }).toBeGreaterThan(0.5);
  await page.mouse.up();
  await expectNoSeriousFault(page);
  await page.getByRole("button", { name: "End the drive" }).click();
  const link = page.getByRole("link", { name: "The whole job" });
  await link.waitFor();
  const id = ((await link.getAttribute("href")) ?? "").split("/").pop() ?? "";
  await expect
    .poll(async () => (await ask<{ state: string }>(`/v1/jobs/${id}`)).state, { timeout: 60_000 })
    .toBe("done");
  const job = await ask<{ model: string; track: string }>(`/v1/jobs/${id}`);
  expect([job.model, job.track.split("/")[0]]).toEqual(["human/ada-drives", "piloted"]);
  expect(faults).toEqual([]);
  await context.close();
});
