import { chromium, type Browser, type Page } from "playwright-core";

export const URL_OF_SERVICE = process.env.BUILDARENA_WEB_URL ?? "";
const CHROMIUM = process.env.BUILDARENA_CHROMIUM ?? "/usr/bin/chromium";
// A machine without a graphics card draws 3D all the same; tests step faster than people.
const ARGUMENTS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-ipc-flooding-protection"];

export function launched(): Promise<Browser> {
  return chromium.launch({ executablePath: CHROMIUM, args: ARGUMENTS });
}

/** Opens a page of the service and waits until it has read what it shows. */
export async function opened(browser: Browser, path: string, width = 1280): Promise<Page> {
  const page = await (await browser.newContext({ viewport: { width, height: 900 } })).newPage();
  await page.goto(URL_OF_SERVICE + path);
  await page.locator("h1").waitFor();
  await page.waitForFunction(() => document.querySelector("[aria-busy=true]") === null);
  return page;
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

export async function openSession(agent: string, seed = 0): Promise<string> {
  const answer = await fetch(`${URL_OF_SERVICE}/v1/sessions`, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ task: "support-1", agent, seed, simulator: "mujoco" }),
  });
  return ((await answer.json()) as { id: string }).id;
}
