import type { Page } from "playwright-core";
import { expect, it } from "vitest";
import { act, ask, expectNoSeriousFault, openSession, settled, visit } from "./browser";

const parts = (page: Page): Promise<number> => page.getByRole("listbox", { name: "Parts" }).getByRole("option").count();

it("takes back, does again, mirrors and tries without counting", async () => {
  const session = await openSession("toy", 0, { kind: "human" });
  await act(session, "start", {});
  const { page, context, faults } = await visit(`/build?session=${session}`);
  const choose = async (part: RegExp, face: RegExp): Promise<void> => {
    await page.getByRole("listbox", { name: "Parts" }).getByRole("option", { name: part }).click();
    await page
      .getByRole("listbox", { name: /^Faces of/ })
      .getByRole("option", { name: face })
      .click();
  };
  await choose(/^1 /, /^A /);
  await page.getByRole("checkbox", { name: /other side too/ }).check();
  await page.getByRole("button", { name: "Attach Small Wooden Block" }).click();
  await expect.poll(() => parts(page)).toBe(3);
  await page.getByRole("button", { name: "Undo" }).click();
  await expect.poll(() => parts(page)).toBe(1);
  await page.getByRole("button", { name: "Redo" }).click();
  await expect.poll(() => parts(page)).toBe(3);
  await expectNoSeriousFault(page);
  await page.getByRole("button", { name: "Practice trial" }).click();
  await page.getByRole("link", { name: "The whole job" }).waitFor();
  expect((await ask<{ open: boolean }>(`/v1/sessions/${session}`)).open).toBe(true);
  expect(faults).toEqual([]);
  await context.close();
});

it("begins with another's machine", async () => {
  const built = await openSession("toy-first", 0);
  await act(built, "start", {});
  await act(built, "attach_block_to", { base_block: "1", face: "A", new_block: "Small Wooden Block" });
  await act(built, "attach_block_to", { base_block: "1", face: "A", new_block: "Small Wooden Block" });
  await ask(`/v1/sessions/${built}/submit`, {});
  const { page, context, faults } = await visit(`/build?task=support-1&remix=${built}`);
  await page.getByText("The session begins with the machine of").waitFor();
  await page.getByLabel("Your name on the board").fill("remixer");
  await page.getByRole("button", { name: "Begin" }).click();
  await page.waitForURL(/session=job_/);
  await settled(page);
  await expect.poll(() => parts(page)).toBe(2);
  expect(faults).toEqual([]);
  await context.close();
});

it("begins with a template of the task's", async () => {
  const { page, context, faults } = await visit("/build?task=transport-1");
  await page.getByLabel("Your name on the board").fill("templated");
  await page.getByRole("combobox", { name: "Begin with" }).click();
  await page.getByRole("option", { name: /^Car chassis/ }).click();
  await page.getByRole("button", { name: "Begin" }).click();
  await page.waitForURL(/session=job_/);
  await settled(page);
  await expect.poll(() => parts(page)).toBe(9);
  expect(faults).toEqual([]);
  await context.close();
});
