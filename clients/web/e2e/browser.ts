import { AxeBuilder } from "@axe-core/playwright";
import { chromium, type BrowserContext, type Locator, type Page } from "playwright-core";
import { afterAll, expect } from "vitest";

export const URL_OF_SERVICE = process.env.BUILDARENA_WEB_URL ?? "";
/** Whether every page is looked at in every look. */
export const ALL_LOOKS = (process.env.BUILDARENA_WEB_ALL_LOOKS ?? "") !== "";
const CHROMIUM = process.env.BUILDARENA_CHROMIUM ?? "/usr/bin/chromium";
// A machine without a graphics card draws 3D all the same; tests step faster than people.
const ARGUMENTS = [
  "--no-sandbox",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--disable-ipc-flooding-protection",
];

const FACES = "ABCDEF";
/** Arguments that put a block on a face of another. */
export const ATTACH = (base: number, face: number): Record<string, string> => ({
  base_block: String(base),
  face: FACES[face % 6] ?? "A",
  new_block: "Small Wooden Block",
});

/** How a browser is started. */
export const LAUNCH = { executablePath: CHROMIUM, args: ARGUMENTS };

/** The browser of a file of tests, ended with it. */
export const browser = await chromium.launch(LAUNCH);
afterAll(() => browser.close());

/** Expects that a page has no serious fault of accessibility. */
export async function expectNoSeriousFault(page: Page): Promise<void> {
  const { violations } = await new AxeBuilder({ page }).analyze();
  const serious = violations.filter((violation) => violation.impact === "serious" || violation.impact === "critical");
  expect(serious.map(({ id, nodes }) => [id, ...nodes.slice(0, 3).map((node) => node.html.slice(0, 160))])).toEqual([]);
}

/** Changes a page's colours and waits until they have faded from one mode to the other, however slow the machine. */
export async function recolour(page: Page, colorScheme: "light" | "dark"): Promise<void> {
  await page.emulateMedia({ colorScheme });
  await page.waitForFunction((scheme) => document.documentElement.dataset.mantineColorScheme === scheme, colorScheme);
  await page.evaluate(async () => {
    const drawn = () => new Promise((resolve) => requestAnimationFrame(resolve));
    const fading = () => document.getAnimations().filter((each) => each instanceof CSSTransition);
    for (await drawn(), await drawn(); fading().length > 0; await drawn()) {
      // A transition that is cancelled by a new one is over too.
      await Promise.allSettled(fading().map((each) => each.finished));
    }
  });
}

/** Waits until a page has read what it shows. */
export async function settled(page: Page): Promise<void> {
  await page.locator("h1").waitFor();
  await page.waitForFunction(() => document.querySelector("[aria-busy=true]") === null);
}

export interface Visit {
  page: Page;
  context: BrowserContext;
  /** Errors in the page's console. */
  faults: string[];
}

/** Opens a page for a new visitor and waits until it has read what it shows. */
export async function visit(
  path: string,
  {
    url = URL_OF_SERVICE,
    width = 1280,
    scheme = "light",
    motion = false,
  }: { url?: string; width?: number; scheme?: "light" | "dark"; motion?: boolean } = {},
): Promise<Visit> {
  const context = await browser.newContext({
    viewport: { width, height: 900 },
    colorScheme: scheme,
    // Trials are still until they are played.
    reducedMotion: motion ? "no-preference" : "reduce",
  });
  const page = await context.newPage();
  const faults: string[] = [];
  page.on("pageerror", (error) => faults.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") faults.push(message.text());
  });
  await page.goto(url + path);
  await settled(page);
  return { page, context, faults };
}

/** A page, and a click that counts. */
export async function asked(
  path: string,
): Promise<Visit & { click: (what: Locator) => Promise<void>; clicks: () => number }> {
  const seen = await visit(path);
  await seen.context.grantPermissions(["clipboard-read", "clipboard-write"]);
  let clicks = 0;
  const click = async (what: Locator): Promise<void> => {
    clicks += 1;
    await what.click();
  };
  return { ...seen, click, clicks: () => clicks };
}

/** Says what an answer took; the bars are those of the pages' design. */
export function expectClicks(question: string, clicks: number, most: number, since: number): void {
  console.log(`${question}: ${clicks} clicks, ${((Date.now() - since) / 1000).toFixed(1)} s`);
  expect(clicks).toBeLessThanOrEqual(most);
}

export async function opened(path: string, width = 1280): Promise<Page> {
  return (await visit(path, { width })).page;
}

/** Calls a tool in an agent's session; tries again while the service does not answer. */
export async function act(session: string, tool: string, argument: unknown): Promise<void> {
  for (;;) {
    try {
      const answer = await fetch(`${URL_OF_SERVICE}/v1/sessions/${session}/calls`, {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ tool, arguments: argument }),
      });
      if (answer.ok) return;
      if (answer.status < 500) throw new Error(await answer.text());
    } catch (error) {
      if (!(error instanceof TypeError)) throw error;
    }
    await new Promise((resolve) => setTimeout(resolve, 200));
  }
}

/** Opens an agent's session; what is named besides takes the place of a bridge of the agent's. */
export async function openSession(agent: string, seed = 0, more: Record<string, unknown> = {}): Promise<string> {
  const answer = await fetch(`${URL_OF_SERVICE}/v1/sessions`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ task: "support-1", agent, seed, simulator: "mujoco", ...more }),
  });
  if (!answer.ok) throw new Error(await answer.text());
  return ((await answer.json()) as { id: string }).id;
}

/** The service's answer to a GET, or to a POST of a body. */
export async function ask<Data>(path: string, body?: unknown): Promise<Data> {
  const init =
    body === undefined
      ? {}
      : { method: "POST", body: JSON.stringify(body), headers: { "Content-Type": "application/json" } };
  const answer = await fetch(URL_OF_SERVICE + path, init);
  expect(answer.ok, path).toBe(true);
  return (await answer.json()) as Data;
}

/** What the cells of a table's body say, row by row. */
export async function textsOf(page: Page, table: string): Promise<string[][]> {
  return page
    .locator(table)
    .evaluate((found) =>
      [...found.querySelectorAll("tbody tr")].map((row) =>
        [...row.children].map((cell) => (cell as HTMLElement).textContent.trim()),
      ),
    );
}
