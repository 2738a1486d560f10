import { describe, expect, it } from "vitest";
import { browser } from "./browser";

/** A service that asks for keys; without one there is nothing to test here. */
const GUARDED = process.env.BUILDARENA_WEB_GUARDED_URL ?? "";
const ADMIN = process.env.BUILDARENA_WEB_ADMIN_KEY ?? "";

describe.skipIf(GUARDED === "")("with keys required", () => {
  it("a key stays for other tabs where its holder says so, and goes everywhere when it is forgotten", async () => {
    const secret = await made("read");
    const context = await browser.newContext();
    const page = await context.newPage();
    await page.goto(`${GUARDED}/sweeps`);
    const alert = page.getByRole("alert");
    await alert.getByRole("checkbox", { name: "Remember on this device" }).check();
    await alert.getByLabel("API key").fill(secret);
    await page.getByRole("button", { name: "Use", exact: true }).click();
    await page.getByText("Nobody has submitted a sweep").waitFor();
    const other = await context.newPage();
    await other.goto(`${GUARDED}/sweeps`);
    await other.getByText("Nobody has submitted a sweep").waitFor();
    await other.getByRole("button", { name: "API key is set" }).click();
    await other.getByRole("button", { name: "Forget" }).click();
    await page.getByRole("button", { name: "Give an API key" }).waitFor();
    await context.close();
  });

  async function made(scope: string): Promise<string> {
    const answer = await fetch(`${GUARDED}/v1/keys`, {
      method: "POST",
      body: JSON.stringify({ name: scope, scopes: [scope] }),
      headers: { "Content-Type": "application/json", Authorization: `Bearer ${ADMIN}` },
    });
    return ((await answer.json()) as { secret: string }).secret;
  }

  it.each([
    ["read", 0],
    ["submit", 1],
  ])("a key of the scope %s has %d ways to submit, and is gone with its tab", async (scope, buttons) => {
    const secret = await made(scope);
    const context = await browser.newContext();
    const page = await context.newPage();
    await page.goto(`${GUARDED}/sweeps`);
    await page.getByRole("alert").getByLabel("API key").fill(secret);
    await page.getByRole("button", { name: "Use", exact: true }).click();
    await page.getByText("Nobody has submitted a sweep").waitFor();
    await expect.poll(() => page.getByRole("link", { name: "New sweep" }).count()).toBe(buttons);
    const other = await context.newPage();
    await other.goto(`${GUARDED}/sweeps`);
    await other.getByRole("alert").waitFor();
    expect(JSON.stringify(await context.storageState())).not.toContain(secret);
    await context.close();
  });
});
