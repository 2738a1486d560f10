// Photographs pages of a service that runs: node screenshots.mjs URL FOLDER [--all]
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { chromium } from "playwright-core";

const [url, folder, ...options] = process.argv.slice(2);
const SIZES = [1280, 390];
const LOADED_STEPS = 240;
const SCHEMES = ["light", "dark"];

const ask = async (path) => (await fetch(url + path)).json();
const first = async (path) => (await ask(path)).data?.[0]?.id;

async function pages() {
  const [newest] = (await ask("/v1/sweeps")).data;
  const built =
    (await first("/v1/jobs?task=support-1&outcome=success&model=builtin/expert")) ??
    (await first("/v1/jobs?outcome=success"));
  const failed = (await first("/v1/jobs?outcome=unsuccessful")) ?? built;
  return {
    board: "/",
    sweeps: "/sweeps",
    sweep: `/sweeps/${newest.id}`,
    "sweeps-new": "/sweeps/new",
    jobs: "/jobs",
    job: `/jobs/${built}`,
    building: `/jobs/${built}?view=building`,
    failed: `/jobs/${failed}`,
    compare: `/compare?a=${built}&b=${failed}`,
    tasks: "/tasks",
    task: "/tasks/support-1",
    model: "/models/builtin/expert",
    build: "/build",
  };
}

async function opened(browser, path, width, colorScheme, height = 900) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme, reducedMotion: "reduce" });
  const page = await context.newPage();
  await page.goto(url + path);
  await page
    .locator("h1")
    .first()
    .waitFor({ timeout: 20_000 })
    .catch(() => undefined);
  await page
    .waitForFunction(() => document.querySelector("[aria-busy=true], .mantine-Skeleton-root") === null, undefined, {
      timeout: 30_000,
    })
    .catch(() => undefined);
  await page.waitForTimeout(1_000);
  return { page, context };
}

async function all(browser, wanted) {
  for (const [name, path] of Object.entries(await pages())) {
    if (wanted.length > 0 && !wanted.includes(name)) continue;
    for (const width of SIZES) {
      for (const scheme of SCHEMES) {
        const { page, context } = await opened(browser, path, width, scheme);
        await page.screenshot({ path: join(folder, `${name}-${width}-${scheme}.png`), fullPage: true });
        await context.close();
      }
    }
    console.log(name);
  }
}

/** The two that the README shows: the board, and a bridge under its load. */
async function shown(browser) {
  const { board, job } = await pages();
  const front = await opened(browser, board, 1280, "light", 800);
  await front.page.screenshot({ path: join(folder, "board.png") });
  await front.context.close();
  const bridge = await opened(browser, job, 1280, "light", 800);
  const canvas = bridge.page.locator("canvas").first();
  await canvas.waitFor({ timeout: 30_000 });
  // Late enough that the load shows, and before most bridges give way.
  const slider = bridge.page.getByRole("slider").first();
  await slider.press("Home");
  for (let step = 0; step < LOADED_STEPS; step += 1) await slider.press("ArrowRight");
  await canvas.evaluate((drawn) => {
    scrollTo(0, drawn.getBoundingClientRect().top + scrollY - 90);
  });
  await bridge.page.waitForTimeout(3_000);
  await bridge.page.screenshot({ path: join(folder, "bridge.png") });
  await bridge.context.close();
}

mkdirSync(folder, { recursive: true });
const browser = await chromium.launch({
  executablePath: process.env.BUILDARENA_CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
await (options.includes("--all")
  ? all(
      browser,
      options.filter((one) => !one.startsWith("--")),
    )
  : shown(browser));
await browser.close();
