import { pathToFileURL } from "node:url";
import { join } from "node:path";
import type { Frame, Page } from "playwright-core";
import { expect, test } from "vitest";
import { browser } from "./browser";

// Pages that notebooks made: tests/cli/notebooks writes them into this folder.
const FOLDER = process.env.BUILDARENA_VIEWER_PAGES ?? "";

interface Drawn {
  scene?: {
    traverse: (
      visit: (found: { userData: { blocks?: string[] }; instanceMatrix?: { array: ArrayLike<number> } }) => void,
    ) => void;
  };
}

interface Opened {
  page: Page;
  faults: string[];
  requests: string[];
}

async function opened(name: string): Promise<Opened> {
  const page = await browser.newPage({ viewport: { width: 900, height: 700 } });
  const [faults, requests]: [string[], string[]] = [[], []];
  page.on("pageerror", (error) => faults.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") faults.push(message.text());
  });
  page.on("request", (request) => requests.push(request.url()));
  page.on("dialog", (dialog) => {
    faults.push(`a dialog: ${dialog.message()}`);
    void dialog.dismiss();
  });
  await page.goto(pathToFileURL(join(FOLDER, name)).href);
  return { page, faults, requests };
}

/** Ids of the blocks that are drawn, and the sum of their places. */
async function drawn(frame: Frame): Promise<{ blocks: string[]; places: number }> {
  await frame.waitForFunction(() => (document.querySelector("canvas") as Drawn | null)?.scene !== undefined);
  return frame.evaluate(() => {
    const blocks: string[] = [];
    let places = 0;
    (document.querySelector("canvas") as Drawn | null)?.scene?.traverse((found) => {
      if (found.userData.blocks === undefined) return;
      blocks.push(...found.userData.blocks);
      places = Array.from(found.instanceMatrix?.array ?? []).reduce(
        (sum, value, index) => sum + (index + 1) * value,
        places,
      );
    });
    return { blocks, places };
  });
}

/** The frame that a notebook shows. */
async function inner(page: Page): Promise<Frame> {
  const handle = await page.waitForSelector("iframe");
  const frame = await handle.contentFrame();
  if (frame === null) throw new Error("the frame is empty");
  return frame;
}

/** How many colours a picture of the page has: page and ground have two, each block has three sides. */
async function colours(page: Page): Promise<number> {
  const picture = (await page.screenshot()).toString("base64");
  const other = await browser.newPage();
  const found = await other.evaluate(async (data) => {
    const image = new Image();
    image.src = `data:image/png;base64,${data}`;
    await image.decode();
    const context = Object.assign(document.createElement("canvas"), {
      width: image.width,
      height: image.height,
    }).getContext("2d");
    context?.drawImage(image, 0, 0);
    const pixels = new Uint32Array(
      context?.getImageData(0, 0, image.width, image.height).data.buffer ?? new ArrayBuffer(0),
    );
    return new Set(pixels).size;
  }, picture);
  await other.close();
  return found;
}

test("a machine is drawn, without any request", async () => {
  const { page, faults, requests } = await opened("machine.html");
  const { blocks } = await drawn(await inner(page));
  expect(blocks.sort()).toEqual(["1", "2", "3"]);
  await expect.poll(() => colours(page), { timeout: 20_000 }).toBeGreaterThan(5);
  expect(faults).toEqual([]);
  expect(requests.filter((url) => !url.startsWith("file:") && url !== "about:srcdoc")).toEqual([]);
  await page.close();
});

test("a trial plays, stops and is set to another time", async () => {
  const { page, faults, requests } = await opened("trial.html");
  const frame = await inner(page);
  const before = await drawn(frame);
  const slider = frame.getByRole("slider");
  await frame.getByRole("button", { name: "Play" }).click();
  await expect.poll(async () => Number(await slider.inputValue()), { timeout: 20_000 }).toBeGreaterThan(0.4);
  await frame.getByRole("button", { name: "Pause" }).click();
  expect((await drawn(frame)).places).not.toEqual(before.places);
  await slider.fill("0");
  await expect.poll(async () => (await drawn(frame)).places, { timeout: 20_000 }).toEqual(before.places);
  expect(faults).toEqual([]);
  expect(requests.filter((url) => !url.startsWith("file:") && url !== "about:srcdoc")).toEqual([]);
  await page.close();
});

test("names from other users are text", async () => {
  const { page, faults } = await opened("hostile.html");
  const frame = await inner(page);
  await drawn(frame);
  expect(await page.evaluate(() => "hurt" in window)).toBe(false);
  expect(await frame.evaluate(() => "hurt" in window)).toBe(false);
  expect(await page.locator("script, img").count()).toBe(0);
  expect(faults).toEqual([]);
  await page.close();
});
