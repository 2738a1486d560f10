import { readFileSync } from "node:fs";
import type { Page } from "playwright-core";
import { describe, expect, it } from "vitest";
import { act, ATTACH, expectNoSeriousFault, opened, openSession, URL_OF_SERVICE } from "./browser";

/** Poses of blocks by id, as (x, y, z, w, x, y, z), and those of refused blocks. */
interface Expected {
  job: string;
  steps: { blocks: Record<string, number[]>; rods: Record<string, number[]>; ghosts: number[][] }[];
}

const FILE = process.env.BUILDARENA_WEB_MACHINES ?? "";
const sessions: Expected[] = FILE === "" ? [] : (JSON.parse(readFileSync(FILE, "utf8")) as Expected[]);

/** Walks through all steps of a job's page and says where its scene graph is not what is expected. */
async function walked(page: Page, expected: Expected): Promise<string[]> {
  return page.evaluate(async ({ steps }) => {
    interface Node {
      userData: { blocks?: string[]; rods?: string[]; ghost?: string };
      instanceMatrix?: { array: Float32Array };
      matrixWorld: { elements: number[] };
      traverse: (visit: (node: Node) => void) => void;
    }
    const NEAR = 1e-5;
    const scene = (document.querySelector("canvas") as unknown as { scene: Node }).scene;
    const apart = (a: ArrayLike<number>, b: readonly number[]): number =>
      Math.max(...b.map((value, k) => Math.abs((a[k] ?? NaN) - value)));
    const matrixOf = ([x = 0, y = 0, z = 0, w = 1, i = 0, j = 0, k = 0]: readonly number[]): number[] => [
      1 - 2 * (j * j + k * k),
      2 * (i * j + k * w),
      2 * (i * k - j * w),
      0,
      2 * (i * j - k * w),
      1 - 2 * (i * i + k * k),
      2 * (j * k + i * w),
      0,
      2 * (i * k + j * w),
      2 * (j * k - i * w),
      1 - 2 * (i * i + j * j),
      0,
      x,
      y,
      z,
      1,
    ];
    const fault = (step: (typeof steps)[number]): string | null => {
      const blocks = new Map<string, Float32Array>();
      const rods = new Map<string, Float32Array>();
      const ghosts: number[][] = [];
      scene.traverse((node) => {
        const matrices = node.instanceMatrix?.array ?? new Float32Array();
        node.userData.blocks?.forEach((id, index) => blocks.set(id, matrices.slice(16 * index, 16 * index + 16)));
        node.userData.rods?.forEach((id, index) => rods.set(id, matrices.slice(16 * index, 16 * index + 16)));
        if (node.userData.ghost !== undefined) ghosts.push(node.matrixWorld.elements);
      });
      if (blocks.size !== Object.keys(step.blocks).length)
        return `${blocks.size} blocks, not ${Object.keys(step.blocks).length}`;
      if (rods.size !== Object.keys(step.rods).length)
        return `${rods.size} connectors, not ${Object.keys(step.rods).length}`;
      for (const [id, pose] of Object.entries(step.blocks)) {
        const off = apart(blocks.get(id) ?? [], matrixOf(pose));
        if (!(off <= NEAR)) return `block ${id} is off by ${off}`;
      }
      for (const [id, ends] of Object.entries(step.rods)) {
        const m = rods.get(id) ?? new Float32Array(16);
        const along = [0, 1, 2].map((k) => (m[4 + k] ?? 0) / 2);
        const drawn = [-1, 1].flatMap((side) => [0, 1, 2].map((k) => (m[12 + k] ?? 0) + side * (along[k] ?? 0)));
        if (!(apart(drawn, ends) <= NEAR)) return `connector ${id} is off by ${apart(drawn, ends)}`;
      }
      if (ghosts.length !== step.ghosts.length) return `${ghosts.length} refused blocks, not ${step.ghosts.length}`;
      const off = Math.max(0, ...step.ghosts.map((pose, index) => apart(ghosts[index] ?? [], matrixOf(pose))));
      return off <= NEAR ? null : `a refused block is off by ${off}`;
    };
    const button = (name: string) => document.querySelector(`button[aria-label="${name}"]`) as HTMLButtonElement;
    const faults: string[] = [];
    button("First step").click();
    for (const [at, step] of steps.entries()) {
      const until = performance.now() + 4000;
      const shown = (): boolean => document.querySelector("[data-step]")?.getAttribute("data-step") === String(at);
      let wrong: string | null = "not shown";
      while (performance.now() < until) {
        wrong = shown() ? fault(step) : "not shown";
        if (wrong === null) break;
        await new Promise((resolve) => requestAnimationFrame(resolve));
      }
      if (wrong !== null) faults.push(`step ${at}: ${wrong}`);
      if (faults.length > 3) break;
      if (at + 1 < steps.length) button("One step on").click();
    }
    return faults;
  }, expected);
}

/** Turns a drawing by the mouse. */
async function dragged(page: Page, canvas: string): Promise<void> {
  const box = await page.locator(canvas).boundingBox();
  if (box === null) throw new Error("no drawing");
  await page.mouse.move(box.x + 100, box.y + 100);
  await page.mouse.down();
  await page.mouse.move(box.x + 220, box.y + 140, { steps: 4 });
  await page.mouse.up();
}

describe.skipIf(sessions.length === 0)("random machines", () => {
  it.each(sessions.map((one, index) => [index, one] as const))(
    "of session %d are where the geometry library says, step by step",
    async (_, expected) => {
      const page = await opened(`/jobs/${expected.job}?step=0`, 390);
      await page.locator("canvas").waitFor();
      await page.waitForFunction(() => "scene" in (document.querySelector("canvas") ?? {}));
      // What is drawn is small: poses are read, and software draws slowly.
      await page.locator(".stage-3d").evaluate((stage) => {
        stage.style.height = "60px";
      });
      expect(await page.locator("[data-steps]").getAttribute("data-steps")).toBe(String(expected.steps.length));
      expect(await walked(page, expected)).toEqual([]);
      await page.close();
    },
  );

  it("show which action made a part, and which part an action made", async () => {
    const session = await openSession("chooser");
    await act(session, "start", {});
    await act(session, "attach_block_to", ATTACH(1, 4));
    const page = await opened(`/jobs/${session}?part=2`);
    await page.getByRole("button", { name: "Step 2 made it." }).waitFor();
    expect(await page.locator(".turn[data-chosen]").getAttribute("data-turn")).toBe("1");
    await page.locator('[data-turn="0"]').getByRole("button", { name: "step 1" }).click();
    await page.waitForURL(/step=0/);
    expect(await page.locator("[data-step]").getAttribute("data-step")).toBe("0");
    expect(await page.locator(".turn[data-chosen]").getAttribute("data-turn")).toBe("0");
    // The keyboard does it too, wherever the focus is in the machine's part.
    await page.getByRole("button", { name: "Last step" }).focus();
    await page.keyboard.press("ArrowRight");
    await page.waitForURL(/step=1/);
    await page.locator("canvas").click();
    await page.waitForURL(/part=/);
    await page.close();
  });
});

describe.skipIf(sessions.length === 0)("two jobs", () => {
  it("are shown side by side, seen by cameras that turn together", async () => {
    const { data: jobs } = (await (
      await fetch(`${URL_OF_SERVICE}/v1/jobs?task=support-1&state=done&outcome=success`)
    ).json()) as { data: { id: string }[] };
    const [a, b] = [jobs[0]?.id ?? "", jobs[1]?.id ?? ""];
    const page = await opened(`/compare?a=${a}&b=${b}`);
    await page.locator("[data-trial=b] canvas").waitFor();
    await expectNoSeriousFault(page);
    const eyes = (): Promise<number[][]> =>
      page.evaluate(() =>
        [...document.querySelectorAll("[data-trial] .stage-3d canvas")].map((canvas) => {
          const { camera } = canvas as unknown as { camera: { quaternion: { toArray: () => number[] } } };
          return camera.quaternion.toArray().map((value) => Math.round(value * 1e4) / 1e4);
        }),
      );
    const [before] = await eyes();
    // Where software draws, the hands may be there before the picture can be turned.
    const turned = async (): Promise<number[] | undefined> => {
      await dragged(page, "[data-trial=a] canvas");
      return (await eyes())[0];
    };
    await expect.poll(turned, { timeout: 40_000, interval: 500 }).not.toEqual(before);
    await expect.poll(async () => new Set((await eyes()).map((eye) => eye.join())).size, { timeout: 10_000 }).toBe(1);
    await page.close();
  });
});

describe.skipIf(sessions.length === 0)("a moment of a trial", () => {
  it("is sent as an address, as a picture and as a film", async () => {
    const { data: jobs } = (await (
      await fetch(`${URL_OF_SERVICE}/v1/jobs?task=support-1&state=done&outcome=success`)
    ).json()) as { data: { id: string }[] };
    const page = await opened(`/jobs/${jobs[0]?.id ?? ""}`);
    await page.locator(".stage-3d canvas").waitFor();
    const slider = page.getByRole("slider", { name: /Time of the trial/ });
    await slider.focus();
    for (let presses = 0; presses < 50; presses++) await page.keyboard.press("ArrowRight");
    const eye = (of: Page): Promise<number[]> =>
      of.evaluate(() => {
        const { camera } = document.querySelector(".stage-3d canvas") as unknown as {
          camera: { position: { toArray: () => number[] } };
        };
        return camera.position.toArray().map((value) => Math.round(value * 10) / 10);
      });
    const start = await eye(page);
    const turned = async (): Promise<number[]> => {
      await dragged(page, ".stage-3d canvas");
      return eye(page);
    };
    await expect.poll(turned, { timeout: 40_000, interval: 500 }).not.toEqual(start);
    const saved = async (button: string): Promise<Buffer> => {
      const [download] = await Promise.all([
        page.waitForEvent("download"),
        page.getByRole("button", { name: button }).click(),
      ]);
      return readFileSync(await download.path());
    };
    const picture = await saved("Share");
    expect(picture.subarray(1, 4).toString()).toBe("PNG");
    expect([picture.readUInt32BE(16), picture.readUInt32BE(20)]).toEqual([1200, 630]);
    await page.waitForURL(/t=2&/);
    expect(page.url()).toMatch(/rollout=0/);
    const seen = await eye(page);
    const again = await page.context().newPage();
    await again.goto(page.url());
    await again.locator(".stage-3d canvas").waitFor();
    expect(await again.getByRole("slider", { name: /Time of the trial/ }).getAttribute("aria-valuenow")).toBe("2");
    await expect.poll(() => eye(again), { timeout: 20_000 }).toEqual(seen);
    await again.close();
    await page.getByRole("button", { name: "Record film" }).click();
    await page.getByRole("button", { name: "Stop and save the film" }).waitFor();
    await page.waitForTimeout(2500);
    const film = await saved("Stop and save the film");
    expect(film.subarray(0, 4).toString("hex")).toBe("1a45dfa3");
    expect(film.length).toBeGreaterThan(5000);
    await page.close();
  });
});
