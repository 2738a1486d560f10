import type { Page } from "playwright-core";
import { expect } from "vitest";

/** Presses beyond its controls: the frame's own, what takes two, and a long list's rows, which are made as they are reached. */
const SPARE = 120;
/** A page that made no control for so long has made all. */
const QUIET_MS = 700;

/** Marks what a person can press, type into or open, and counts it. */
function markControls(page: Page): Promise<number> {
  return page.evaluate(() => {
    const kinds = "a[href], button, input, select, textarea, summary, [tabindex], [contenteditable=true]";
    const controls = [...document.querySelectorAll<HTMLElement>(kinds)].filter((found) => {
      const off = found.matches(":disabled, [tabindex='-1'], [type=hidden], [aria-hidden=true], [aria-hidden=true] *");
      if (off || !found.checkVisibility({ visibilityProperty: true })) return false;
      if (!(found instanceof HTMLInputElement) || found.type !== "radio") return true;
      // Of radio buttons Tab reaches the chosen one, and the arrows the others.
      const group = document.querySelectorAll<HTMLInputElement>(`input[type=radio][name="${found.name}"]`);
      return found.checked || ![...group].some((one) => one.checked);
    });
    for (const control of controls) control.dataset.walk = "wanted";
    document.addEventListener("focusin", ({ target }) => {
      if (target instanceof HTMLElement) target.dataset.walk = "reached";
    });
    (document.activeElement as HTMLElement | null)?.blur();
    return controls.length;
  });
}

function missed(page: Page): Promise<string[]> {
  return page.evaluate(() =>
    [...document.querySelectorAll('[data-walk="wanted"]')].map((control) => control.outerHTML.slice(0, 160)),
  );
}

/** Marks the controls once a page makes no more of them; how many there are. */
async function settledControls(page: Page): Promise<number> {
  for (let before = -1; ;) {
    const now = await markControls(page);
    if (now === before) return now;
    before = now;
    await page.waitForTimeout(QUIET_MS);
  }
}

/** Expects that Tab alone reaches every control of a page. */
export async function expectAllReached(page: Page): Promise<void> {
  const controls = await settledControls(page);
  for (let presses = 0; presses < controls + SPARE; presses += 1) {
    await page.keyboard.press("Tab");
    if (presses >= controls - 1 && (await missed(page)).length === 0) break;
  }
  expect(await missed(page), page.url()).toEqual([]);
}
