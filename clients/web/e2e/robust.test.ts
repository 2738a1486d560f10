import { expect, it } from "vitest";
import { expectNoSeriousFault, settled, URL_OF_SERVICE, visit, browser } from "./browser";

it("leads on from an address that there is not", async () => {
  const context = await browser.newContext();
  const page = await context.newPage();
  const answer = await page.goto(`${URL_OF_SERVICE}/nonsense/here`);
  expect(answer?.status()).toBe(404);
  await page.getByRole("heading", { name: "Not found" }).waitFor();
  await expectNoSeriousFault(page);
  await page.getByRole("main").getByRole("link", { name: "all tasks" }).click();
  await page.getByRole("heading", { name: "Tasks" }).waitFor();
  await context.close();
});

it("stays while the service is away, and comes back by itself", async () => {
  const { page, context } = await visit("/");
  // The scripts of all pages, when there is nothing else to do.
  const last = (): Promise<boolean> =>
    page.evaluate(() => performance.getEntriesByType("resource").some(({ name }) => name.includes("SweepsPage-")));
  await expect.poll(last, { timeout: 25_000 }).toBe(true);
  await context.route("**/*", (route) => route.abort());
  await page.getByRole("navigation").getByRole("link", { name: "Runs", exact: true }).click();
  await page
    .getByText(/no answer came/)
    .first()
    .waitFor();
  expect(new URL(page.url()).pathname).toBe("/sweeps");
  await context.unroute("**/*");
  await expect.poll(() => page.getByText(/no answer came/).count(), { timeout: 15_000 }).toBe(0);
  await settled(page);
  await context.close();
});
