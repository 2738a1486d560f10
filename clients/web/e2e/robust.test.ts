import { expect, it } from "vitest";
import { settled, visit } from "./browser";

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
