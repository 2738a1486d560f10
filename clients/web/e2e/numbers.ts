import type { Page } from "playwright-core";
import { expect } from "vitest";
import type { components } from "../src/api/contract";
import { count, dollars, number, percent, places } from "../src/format";

type Schemas = components["schemas"];
type Ask = <Data>(path: string) => Promise<Data>;

/** A page of one track, and the numbers that it must show as the service has them. */
export interface Numbers {
  name: string;
  path: string;
  expected: string[];
}

const TASK = "support-1";
export const MODEL = "builtin/expert";
const LEAST = 8;

/** What pages must show of a track. */
export async function numbersOf(track: string, ask: Ask): Promise<Numbers[]> {
  const on = `track=${encodeURIComponent(track)}`;
  const board = await ask<Schemas["Board"]>(`/v1/leaderboard?${on}`);
  const task = await ask<Schemas["Board"]>(`/v1/leaderboard?${on}&task=${TASK}`);
  const { data: jobs } = await ask<Schemas["JobList"]>(`/v1/jobs?${on}&model=${MODEL}&task=${TASK}&outcome=success`);
  const [done] = jobs;
  if (done === undefined) throw new Error(`no job of ${MODEL} succeeded on ${track}`);
  const job = await ask<Schemas["JobDetail"]>(`/v1/jobs/${done.id}`);
  const own = board.overall.find((row) => row.model === MODEL);
  const rows = task.tasks.flatMap((one) => one.rows);
  return [
    {
      name: "board",
      path: `/?${on}`,
      expected: board.overall.flatMap((row) => [
        ...(row.baseline ? [] : [places(row.rank_low, row.rank_high)]),
        number(row.score_mean, 2),
        percent(row.success_rate_mean),
        dollars(row.cost_usd_mean),
        count(row.counted),
      ]),
    },
    {
      name: "task",
      path: `/tasks/${TASK}?${on}`,
      expected: rows.flatMap((row) => [
        percent(row.success_rate),
        number(row.indicator_mean),
        number(row.indicator_best),
        number(row.score, 2),
        percent(row.refused_action_rate),
      ]),
    },
    {
      name: "model",
      path: `/models/${MODEL}?${on}`,
      expected: [
        number(own?.score_mean, 2),
        percent(own?.success_rate_mean, 1),
        dollars(own?.cost_usd_mean),
        count(own?.output_tokens_mean),
        count(own?.counted),
        ...rows
          .filter((row) => row.model === MODEL)
          .flatMap((row) => [percent(row.success_rate), number(row.indicator_mean), number(row.indicator_best)]),
      ],
    },
    {
      name: "job",
      path: `/jobs/${job.id}?view=measurements`,
      expected: [
        number(job.indicator),
        count(job.actions),
        count(job.refused_actions),
        count(job.usage.requests),
        dollars(job.usage.cost_usd),
        ...Object.values(job.metrics)
          .filter((value) => typeof value === "number")
          .map((value) => number(value, Number.isInteger(value) ? 0 : 2)),
      ],
    },
  ];
}

/** Expects that a page shows these numbers, each as often as it is asked for at least once. */
export async function expectNumbers(page: Page, { name, expected }: Numbers): Promise<void> {
  const wanted = expected.filter((text) => /\d/.test(text)).slice(0, 20);
  expect(wanted.length, name).toBeGreaterThanOrEqual(LEAST);
  const lacking = async (): Promise<string[]> => {
    const shown = await page.locator("main").evaluate((main) => {
      for (const fold of main.querySelectorAll("details")) fold.open = true;
      return (main as HTMLElement).innerText;
    });
    return wanted.filter((text) => !hasNumber(shown, text));
  };
  await expect.poll(lacking, { timeout: 15_000, message: name }).toEqual([]);
}

/** Whether a text has a number that is not part of a longer one. */
function hasNumber(text: string, wanted: string): boolean {
  const pattern = wanted.replace(/[.*+?^${}()|[\]\\]/g, "\\$&").replace(/\s/g, "\\s");
  return new RegExp(`(^|[^\\d.,])${pattern}(?![\\d]|[.,]\\d)`).test(text);
}
