import { writeFileSync } from "node:fs";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, describe, it } from "vitest";
import { launched, opened, URL_OF_SERVICE } from "./browser";

/** What is measured: "FILE,JOB of 135 blocks with a trial,JOB of 300 turns". */
const [file, large = "", long = ""] = (process.env.BUILDARENA_WEB_BENCH ?? "").split(",");
const figures: Record<string, number> = {};

let browser: Browser;
beforeAll(async () => {
  browser = await launched();
});
afterAll(async () => {
  if (file !== undefined && file !== "") writeFileSync(file, JSON.stringify(figures));
  await browser.close();
});

/** Frames a second that the page gets done, and its slowest, while something goes on for some seconds. */
async function frames(
  page: Page,
  seconds: number,
  eachFrame: "scroll" | "turn" | "none",
): Promise<{ fps: number; worst: number }> {
  return page.evaluate(
    async ([length, kind]) => {
      const box = document.querySelector('[aria-label="Transcript, scrolls"]');
      const canvas = document.querySelector("canvas");
      const gaps: number[] = [];
      const began = performance.now();
      let before = began;
      let x = 100;
      if (kind === "turn")
        canvas?.dispatchEvent(
          new PointerEvent("pointerdown", {
            bubbles: true,
            pointerId: 1,
            button: 0,
            buttons: 1,
            clientX: x,
            clientY: 100,
            pointerType: "mouse",
          }),
        );
      while (before - began < length * 1000) {
        if (kind === "scroll" && box !== null) box.scrollTop += 120;
        if (kind === "turn")
          canvas?.dispatchEvent(
            new PointerEvent("pointermove", {
              bubbles: true,
              pointerId: 1,
              buttons: 1,
              clientX: (x += 3),
              clientY: 100,
              pointerType: "mouse",
            }),
          );
        const now = await new Promise<number>((resolve) => requestAnimationFrame(resolve));
        gaps.push(now - before);
        before = now;
      }
      return { fps: gaps.length / ((before - began) / 1000), worst: Math.max(...gaps.slice(1)) };
    },
    [seconds, eachFrame] as const,
  );
}

/** A track whose board has thousands of jobs. */
const board = process.env.BUILDARENA_WEB_BOARD ?? "";
const THROTTLE = 4;

describe.skipIf(board === "")("a board of thousands of jobs", () => {
  it("leaves the page's thread free", async () => {
    const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
    const session = await page.context().newCDPSession(page);
    await session.send("Emulation.setCPUThrottlingRate", { rate: THROTTLE });
    await page.addInitScript(() => {
      const found: number[] = [];
      Object.assign(globalThis, { longTasks: found });
      new PerformanceObserver((list) => {
        for (const entry of list.getEntries()) found.push(entry.duration);
      }).observe({ type: "longtask", buffered: true });
    });
    const longest = (): Promise<number> =>
      page.evaluate(() => Math.max(0, ...(globalThis as unknown as { longTasks: number[] }).longTasks.splice(0)));
    const began = performance.now();
    await page.goto(`${URL_OF_SERVICE}/?track=${encodeURIComponent(board)}`);
    await page.locator("a.heat-cell").first().waitFor();
    figures.shown_ms_board_4x = performance.now() - began;
    await page.waitForTimeout(4000);
    figures.longest_task_ms_board_4x = await longest();
    await page.getByText("Every figure, task by task").click();
    await page.waitForTimeout(2000);
    figures.longest_task_ms_board_figures_4x = await longest();
    await page.getByText("Bridges", { exact: true }).click();
    await page.waitForTimeout(2000);
    figures.longest_task_ms_board_scope_4x = await longest();
    await page.close();
  });
});

describe.skipIf(large === "")("speed", () => {
  it("of 3D", async () => {
    const page = await opened(browser, `/jobs/${large}`);
    await page.locator("canvas").waitFor();
    await page.waitForTimeout(1500);
    figures.fps_machine_135_blocks = (await frames(page, 4, "turn")).fps;
    await page.getByRole("tab", { name: "The trial" }).click();
    await page.getByRole("button", { name: "Play" }).click();
    await page.waitForTimeout(500);
    figures.fps_trial_135_blocks = (await frames(page, 5, "none")).fps;
    await page.close();
  });

  it("of a long transcript", async () => {
    const page = await opened(browser, `/jobs/${long}?step=0`);
    await page.getByText("300 turns", { exact: true }).waitFor();
    await page.waitForTimeout(1500);
    figures.worst_frame_ms_scrolling_300_turns = (await frames(page, 5, "scroll")).worst;
    await page.close();
  });

  it("of the first page", async () => {
    const times: number[] = [];
    for (let run = 0; run < 4; run += 1) {
      const page = await browser.newPage();
      let script = 0;
      page.on("response", (response) => {
        if (response.url().endsWith(".js")) script += Number(response.headers()["content-length"] ?? 0);
      });
      const began = performance.now();
      await page.goto(URL_OF_SERVICE);
      await page.locator(".heat, table").first().waitFor();
      times.push(performance.now() - began);
      await page.waitForTimeout(500);
      figures.script_kb_first_page = script / 1000;
      await page.close();
    }
    times.sort((a, b) => a - b);
    figures.interactive_ms_first_page = times[1] ?? 0;
  });
});
