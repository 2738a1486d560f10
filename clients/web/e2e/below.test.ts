import { expect, it } from "vitest";
import { settled, URL_OF_SERVICE, visit } from "./browser";

const BASE = new URL(URL_OF_SERVICE).pathname;

it("links, reads and listens below the path", async () => {
  const { page, context, faults } = await visit("/");
  const strays: string[] = [];
  page.on("request", (request) => {
    const { protocol, pathname } = new URL(request.url());
    if (protocol.startsWith("http") && !pathname.startsWith(`${BASE}/`)) strays.push(pathname);
  });
  for (const name of ["Tasks", "Build", "Method", "Leaderboard"]) {
    await page.getByRole("navigation").getByRole("link", { name, exact: true }).click();
    await page.waitForURL(`**${BASE}/${name === "Leaderboard" ? "" : name.toLowerCase()}*`);
    await settled(page);
  }
  const stream = page.waitForResponse((answer) => answer.url().endsWith("/events"));
  await page.goto(`${URL_OF_SERVICE}/sweeps`);
  await page.getByRole("link", { name: "pages" }).first().click();
  expect((await stream).status()).toBe(200);
  await page.reload();
  await settled(page);
  expect(await page.getByRole("link", { name: "API documentation" }).getAttribute("href")).toBe(`${BASE}/docs`);
  expect(strays).toEqual([]);
  expect(faults).toEqual([]);
  await context.close();
});
