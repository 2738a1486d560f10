import type { Browser } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import { expectNoSeriousFault, launched, visit } from "./browser";
import { expectAllReached } from "./walking";

const PACKAGES = process.env.BUILDARENA_WEB_PACKAGES ?? "";
const PICTURES = process.env.BUILDARENA_WEB_PICTURES;

let browser: Browser;
beforeAll(async () => {
  browser = await launched();
});
afterAll(async () => {
  await browser.close();
});

describe("challenges", () => {
  it("lead from the list to a season's rules", async () => {
    const { page, context, faults } = await visit(browser, "/challenges");
    await page.getByRole("link", { name: "First bridges" }).click();
    await page.getByText("No package has been scored on this track yet").waitFor();
    await page.getByText("full are support-1 at 1,600", { exact: false }).waitFor();
    expect(faults).toEqual([]);
    await context.close();
  });

  it("say what is wrong with a package before it is handed in", async () => {
    const { page, context } = await visit(browser, "/challenges/first-bridges");
    await page.getByLabel("Package", { exact: true }).setInputFiles(`${PACKAGES}/broken.zip`);
    await page.getByText("support-2.json is missing", { exact: false }).first().waitFor();
    expect(await page.getByRole("button", { name: "Hand in" }).isDisabled()).toBe(true);
    await context.close();
  });

  it.each(["light", "dark"] as const)("take a package and rank it, %s", async (scheme) => {
    const { page, context, faults } = await visit(browser, "/challenges/first-bridges", { scheme });
    await page.getByLabel("Package", { exact: true }).setInputFiles(`${PACKAGES}/sound.zip`);
    await page.getByText("every rule is kept", { exact: false }).waitFor({ timeout: 60_000 });
    await page.getByLabel("Name of the entry").fill("Three bridges");
    await page.getByRole("button", { name: "Hand in" }).click();
    await page.getByRole("status").filter({ hasText: "package_" }).waitFor();
    const board = page.getByRole("table", { name: "Board of the season" });
    await board.getByText("Three bridges").waitFor({ timeout: 60_000 });
    await page.getByRole("table", { name: "Your packages" }).getByText("scored").waitFor();
    await expectNoSeriousFault(page);
    expect(faults).toEqual([]);
    await expectAllReached(page);
    if (PICTURES !== undefined) await page.screenshot({ path: `${PICTURES}/season-${scheme}.png`, fullPage: true });
    await board.getByRole("link", { name: "Three bridges" }).first().click();
    await page.getByRole("heading", { name: "support-3.json" }).waitFor();
    await page.getByRole("rowheader", { name: "machines" }).waitFor();
    await expectNoSeriousFault(page);
    expect(faults).toEqual([]);
    await expectAllReached(page);
    if (PICTURES !== undefined) await page.screenshot({ path: `${PICTURES}/entry-${scheme}.png`, fullPage: true });
    await context.close();
  });

  it.each(["light", "dark"] as const)("show a flight round a planet, %s", async (scheme) => {
    const { page, context, faults } = await visit(browser, "/challenges/s01-stable-orbit", { scheme });
    await page.getByLabel("Package", { exact: true }).setInputFiles(`${PACKAGES}/flight.zip`);
    await page.getByText("every rule is kept", { exact: false }).waitFor({ timeout: 60_000 });
    await page.getByLabel("Name of the entry").fill("Thrustcraft");
    await page.getByRole("button", { name: "Hand in" }).click();
    const board = page.getByRole("table", { name: "Board of the season" });
    await board.getByRole("link", { name: "Thrustcraft" }).click({ timeout: 60_000 });
    await page.getByRole("img", { name: "The planet from the side", exact: false }).waitFor();
    await page.getByText("Height over the start").waitFor();
    await expectNoSeriousFault(page);
    expect(faults).toEqual([]);
    if (PICTURES !== undefined) await page.screenshot({ path: `${PICTURES}/flight-${scheme}.png`, fullPage: true });
    await context.close();
  });

  it("fit a phone", async () => {
    const { page, context } = await visit(browser, "/challenges/s01-stable-orbit", { width: 390 });
    await page.getByText("Not published", { exact: false }).first().waitFor();
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    expect(wide).toBeLessThanOrEqual(390);
    if (PICTURES !== undefined) await page.screenshot({ path: `${PICTURES}/season-phone.png`, fullPage: true });
    await context.close();
  });
});
