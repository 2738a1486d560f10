import { Progress, SimpleGrid, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import type { ReactNode } from "react";
import { sweepForecast, type Forecast, type Sweep } from "../../api/queries";
import { isSite } from "../../api/site";
import { count, dollars, duration, moment, number, percent, stateWords } from "../../format";
import { Fact } from "../../parts/Fact";

/** How much of a budget is used; nothing where there is none. */
function shareOf(spent: number | null | undefined, most: number | null | undefined): number | undefined {
  return spent == null || most == null || most === 0 ? undefined : spent / most;
}

interface Shown {
  name: string;
  value: string;
  notes: readonly ReactNode[];
  share?: number | undefined;
}

function rateOf(forecast: Forecast | undefined): Shown {
  const rate = forecast?.jobs_per_minute ?? null;
  if (forecast === undefined || rate === null) return { name: "Rate", value: "–", notes: [] };
  const end = forecast.finish_at;
  return {
    name: "Rate",
    value: `${number(rate)} a minute`,
    notes: [
      end !== null && (
        <time dateTime={end} title={`about ${moment(end)}`}>
          {forecast.remaining_jobs < rate
            ? "less than a minute left"
            : `about ${duration((60 * forecast.remaining_jobs) / rate)} left`}
        </time>
      ),
    ],
  };
}

function spentOf({ progress, budget }: Sweep, forecast: Forecast | undefined): Shown {
  const short = forecast?.lacking_budget_usd ?? 0;
  const unknown = forecast?.unknown_models ?? [];
  return {
    name: "Spent",
    value: dollars(progress.usage.cost_usd),
    notes: [
      budget?.max_cost_usd == null ? "no budget in dollars" : `of ${dollars(budget.max_cost_usd)}`,
      forecast !== undefined && forecast.remaining_cost_usd > 0 && `about ${dollars(forecast.total_cost_usd)} in all`,
      unknown.length > 0 && `no cost known yet: ${unknown.join(", ")}`,
      short > 0 && <b>the budget lacks about {dollars(short)}</b>,
    ],
    share: shareOf(budget?.used_cost_usd, budget?.max_cost_usd),
  };
}

/** Where a sweep is, how fast it goes, and what it costs and comes to cost. */
export function SweepFacts({ sweep }: { sweep: Sweep }) {
  const { progress } = sweep;
  const open = !isSite && progress.done < progress.total;
  const asked = useQuery({ ...sweepForecast(sweep.id), enabled: open });
  const forecast = open ? asked.data : undefined;
  const facts: readonly Shown[] = [
    {
      name: "Jobs ended",
      value: `${count(progress.done)} of ${count(progress.total)}`,
      notes: Object.entries(progress.stages).map(([name, n]) => `${count(n)} ${stateWords(name)}`),
    },
    rateOf(forecast),
    spentOf(sweep, forecast),
  ];
  return (
    <SimpleGrid cols={{ base: 1, xs: 3 }}>
      {facts.map(({ name, value, notes, share }) => (
        <Fact key={name} name={name} value={value}>
          {notes.map((note, index) => (
            <Text key={index} size="xs" className="dimmed">
              {note}
            </Text>
          ))}
          {share !== undefined && (
            <Progress
              value={Math.min(100, 100 * share)}
              size="sm"
              mt={4}
              color={share > 0.9 ? "orange" : "blue"}
              aria-label={`${name}: ${percent(share)} of the budget`}
            />
          )}
        </Fact>
      ))}
    </SimpleGrid>
  );
}
