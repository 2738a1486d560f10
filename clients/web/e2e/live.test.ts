import type { Page } from "playwright-core";
import { describe, expect, it } from "vitest";
import { act, ATTACH, opened, openSession, URL_OF_SERVICE } from "./browser";

const PLAYED = process.env.BUILDARENA_WEB_PLAYED ?? "";
const WORKERS = pids(process.env.BUILDARENA_WEB_WORKERS);
const APIS = pids(process.env.BUILDARENA_WEB_APIS);

function pids(named: string | undefined): number[] {
  return (named ?? "")
    .split(",")
    .filter((pid) => pid !== "")
    .map(Number);
}

function kill(processes: readonly number[]): void {
  for (const pid of processes) process.kill(pid, "SIGKILL");
}

/** The page of a job that is watched from here on; a reload would be noticed. */
async function watched(job: string): Promise<Page> {
  const page = await opened(`/jobs/${job}`);
  await page.locator("[data-live=live]").waitFor();
  await page.evaluate(() => Object.assign(window, { kept: true }));
  return page;
}

async function steps(page: Page, count: number): Promise<void> {
  await page.waitForFunction(
    (least) => Number(document.querySelector("[data-steps]")?.getAttribute("data-steps") ?? 0) >= least,
    count,
    { timeout: 40_000 },
  );
}

/** Which turns a page shows as it is scrolled through; none twice at a time. */
async function turnsShown(page: Page): Promise<number[]> {
  const seen = new Set<number>();
  const box = page.getByRole("region", { name: "Transcript, scrolls" });
  await box.evaluate((element) => {
    element.scrollTop = 0;
  });
  for (;;) {
    await page.waitForTimeout(40);
    const now = await page
      .locator("[data-turn]")
      .evaluateAll((found) => found.map((one) => Number(one.getAttribute("data-turn"))));
    expect(new Set(now).size).toBe(now.length);
    for (const one of now) seen.add(one);
    const more = await box.evaluate((element) => {
      const before = element.scrollTop;
      element.scrollTop += element.clientHeight / 2;
      return element.scrollTop > before;
    });
    if (!more) return [...seen].sort((a, b) => a - b);
  }
}

describe.skipIf(PLAYED === "")("a session under way", () => {
  it("continues before the reader's eyes when its worker is killed; no turn is lost or doubled", async () => {
    const page = await watched(PLAYED);
    await steps(page, 4);
    kill(WORKERS);
    await page.getByText("succeeded", { exact: true }).first().waitFor({ timeout: 50_000 });
    const answer = await fetch(`${URL_OF_SERVICE}/v1/jobs/${PLAYED}/transcript`);
    const kept = ((await answer.json()) as { turns: { index: number }[] }).turns.map((turn) => turn.index);
    await page.getByText(`${kept.length} turns`, { exact: true }).waitFor();
    expect(await turnsShown(page)).toEqual(kept);
    expect(await page.evaluate(() => "kept" in window)).toBe(true);
    await page.close();
  });

  it("shows each turn soon, also over a service that dies; no turn is lost or doubled", async () => {
    const session = await openSession("watched");
    const page = await watched(session);
    const waits: number[] = [];
    const total = 36;
    const before = 31;
    for (let turn = 0; turn < total; turn += 1) {
      const began = performance.now();
      await act(
        session,
        turn === 0 ? "start" : "attach_block_to",
        turn === 0 ? {} : ATTACH(1 + Math.floor(turn / 3), turn),
      );
      await steps(page, turn + 1);
      if (turn < before) waits.push(performance.now() - began);
      if (turn === before - 1) kill(APIS);
    }
    waits.sort((a, b) => a - b);
    const median = waits[before >> 1] ?? Infinity;
    console.log(
      JSON.stringify({
        live_turns: waits.length,
        median_ms: Math.round(median),
        worst_ms: Math.round(waits.at(-1) ?? 0),
      }),
    );
    expect(median).toBeLessThan(1500);
    expect(await page.getByText(`${total} turns`, { exact: true }).count()).toBe(1);
    expect(await turnsShown(page)).toEqual([...Array(total).keys()]);
    expect(await page.evaluate(() => "kept" in window)).toBe(true);
    await page.close();
  });
});
