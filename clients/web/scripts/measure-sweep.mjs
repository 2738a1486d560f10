// Measures a sweep's page while its jobs end: node measure-sweep.mjs URL SWEEP SECONDS; JSON to stdout.
import { chromium } from "playwright-core";

const [url, sweep, seconds] = process.argv.slice(2);

const browser = await chromium.launch({
  executablePath: process.env.BUILDARENA_CHROMIUM || "/usr/bin/chromium",
  args: ["--no-sandbox", "--enable-precise-memory-info"],
});
const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
await page.addInitScript(() => {
  globalThis.longTasks = [];
  new PerformanceObserver((list) => {
    for (const entry of list.getEntries()) globalThis.longTasks.push({ at: entry.startTime, took: entry.duration });
  }).observe({ type: "longtask", buffered: true });
});
const start = performance.now();
await page.goto(`${url}/sweeps/${sweep}`);
await page.locator("h1").waitFor();
const firstShown = performance.now() - start;
await page.locator(".heat-cell").first().waitFor();
const gridShown = performance.now() - start;
await page.getByText("live", { exact: true }).waitFor({ timeout: 120_000 });
const complete = performance.now() - start;
const loadedAt = await page.evaluate(() => performance.now());

const clicks = [];
const jobsShown = () =>
  page
    .getByText(/^construction failed: /)
    .first()
    .textContent({ timeout: 2_000 })
    .catch(() => null);
const before = await jobsShown();
const memory = () => page.evaluate(() => performance.memory.usedJSHeapSize / 2 ** 20);
const heap = [await memory()];
const end = performance.now() + 1000 * Number(seconds);
while (performance.now() < end) {
  // From a click's event to the frame that shows what it did.
  clicks.push(
    await page.evaluate(async () => {
      const button = document.querySelector("button[aria-label='Give an API key']");
      const at = performance.now();
      button.click();
      await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
      return performance.now() - at;
    }),
  );
  await page
    .locator("[role=region][aria-label$=scrolls]")
    .last()
    .evaluate((frame) => frame.scrollBy(0, 2000));
  heap.push(await memory());
  await page.waitForTimeout(1_000);
}
const tasks = await page.evaluate(() => globalThis.longTasks);
const after = tasks.filter((task) => task.at > loadedAt);
clicks.sort((a, b) => a - b);
const round = (value) => Math.round(value);
console.log(
  JSON.stringify({
    first_shown_ms: round(firstShown),
    grid_shown_ms: round(gridShown),
    all_jobs_read_ms: round(complete),
    longest_task_while_loading_ms: round(
      Math.max(0, ...tasks.filter((task) => task.at <= loadedAt).map((task) => task.took)),
    ),
    long_tasks_after_load: after.length,
    longest_task_after_load_ms: round(Math.max(0, ...after.map((task) => task.took))),
    click_median_ms: round(clicks[Math.floor(clicks.length / 2)]),
    click_longest_ms: round(clicks.at(-1)),
    heap_mib_at_start_and_end: [round(heap[0]), round(heap.at(-1))],
    heap_mib_most: round(Math.max(...heap)),
    shown: [before, await jobsShown()],
  }),
);
await browser.close();
