import { createServer, type Server } from "node:http";
import type { AddressInfo } from "node:net";
import { chromium, type Browser, type Page } from "playwright-core";
import { afterAll, beforeAll, describe, expect, it } from "vitest";
import { LAUNCH, URL_OF_SERVICE } from "./browser";

/** A name that a page's owner lets point to the reader's own machine, once its page is there. */
const REBOUND = "rebound.example";
const SWEEP = JSON.stringify({ name: "hostile", tasks: ["support-1"], models: ["builtin/idle"], samples: 1 });

let browser: Browser;
let server: Server;
let port = 0;

async function sweeps(): Promise<number> {
  const answer = await fetch(`${URL_OF_SERVICE}/v1/sweeps`);
  return ((await answer.json()) as { data: unknown[] }).data.length;
}

async function page(host: string): Promise<Page> {
  const context = await browser.newContext();
  const opened = await context.newPage();
  await opened.goto(`http://${host}:${port}/`);
  return opened;
}

/** What a page gets that asks the service for something; the answer's status, or what failed. */
function asked(from: Page, url: string, init: RequestInit = {}): Promise<string> {
  return from.evaluate(
    ([address, options]) =>
      fetch(address, options).then(
        (answer) => `${answer.type} ${answer.status}`,
        (error: unknown) => String(error),
      ),
    [url, init] as const,
  );
}

describe("a page of somebody else", () => {
  beforeAll(async () => {
    server = createServer((_, answer) => {
      answer.setHeader("Content-Type", "text/html");
      answer.end("<!doctype html><title>a nice page</title><p>Nothing to see here.");
    });
    await new Promise<void>((resolve) => server.listen(0, "127.0.0.1", resolve));
    port = (server.address() as AddressInfo).port;
    const args = [...LAUNCH.args, `--host-resolver-rules=MAP ${REBOUND} 127.0.0.1`];
    browser = await chromium.launch({ ...LAUNCH, args });
  });
  afterAll(async () => {
    await browser.close();
    await new Promise((resolve) => server.close(resolve));
  });

  it.each(["127.0.0.1", "localhost", REBOUND])("at %s reads nothing and changes nothing", async (host) => {
    const before = await sweeps();
    const hostile = await page(host);
    const post = { method: "POST", body: SWEEP };
    for (const path of ["/v1/jobs", "/v1/health", "/openapi.json", "/v1/events"])
      expect(await asked(hostile, URL_OF_SERVICE + path)).toBe("TypeError: Failed to fetch");
    const tries: RequestInit[] = [
      { ...post, headers: { "Content-Type": "application/json" } },
      { ...post, headers: { "Content-Type": "text/plain" } },
      { ...post, mode: "no-cors" },
      { ...post, mode: "no-cors", credentials: "include" },
    ];
    for (const init of tries)
      expect(["TypeError: Failed to fetch", "opaque 0"]).toContain(
        await asked(hostile, `${URL_OF_SERVICE}/v1/sweeps`, init),
      );
    expect(await sweeps()).toBe(before);
    await hostile.context().close();
  });

  it("frames no page", async () => {
    const hostile = await page("localhost");
    await hostile.evaluate((url) => {
      const frame = document.createElement("iframe");
      frame.src = url;
      document.body.append(frame);
    }, `${URL_OF_SERVICE}/jobs`);
    await expect.poll(() => hostile.frames().length).toBe(2);
    const [, framed] = hostile.frames();
    await framed?.waitForLoadState();
    expect(await framed?.locator("h1").count()).toBe(0);
    await hostile.context().close();
  });

  it("whose name is the service's own address by now is told nothing", async () => {
    const hostile = await page(REBOUND);
    const service = `http://${REBOUND}:${new URL(URL_OF_SERVICE).port}`;
    expect(await asked(hostile, `${service}/v1/jobs`, { mode: "no-cors" })).toMatch(/opaque|TypeError/);
    // The page itself at the service's port: from there on it is of one origin with the service.
    const answer = await hostile.goto(`${service}/`);
    expect(answer?.status()).toBe(421);
    expect(await asked(hostile, `${service}/v1/jobs`)).toBe("basic 421");
    expect(await asked(hostile, `${service}/v1/sweeps`, { method: "POST", body: SWEEP })).toBe("basic 421");
    await hostile.context().close();
  });
});
