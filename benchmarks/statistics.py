"""Measures what the leaderboard's statistics promise, on made-up trials whose truth is known.

How often intervals hold, over numbers of trials, success rates and shapes of the indicator; how
many boards of models that are alike call one of them better; and how often a model that is better
is called so.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from benchmarks.figures import keep
from scipy.stats import binom
from support.boards.made_up_trials import (
    LOADS,
    RARE,
    RATES,
    SIZES,
    Loads,
    board,
    coverage,
    rankings,
)

from buildarena_benchmark.statistics import MIN_SUCCESSES, exact_interval, wilson_interval

MODELS, TASKS = 12, 9
SELDOM = 0.02
"""Where intervals are shown less often, their coverage is not measured."""
CLAIMED = ("lognormal, sigma 0.8", "lognormal, sigma 1.2", "censored at 1500", "near constant")
MIXED = (4, 8, 16, 64) * 3
"""Trials of the models of a board that is not yet complete."""


def covered(trials: int, rate: float, method: str) -> float:
    """How often an interval of a success rate holds it, exactly."""
    interval = {"exact": exact_interval, "Wilson": wilson_interval}[method]
    held = [low <= rate <= high for low, high in (interval(k, trials) for k in range(trials + 1))]
    return float(np.sum(binom.pmf(np.arange(trials + 1), trials, rate) * held))


def rates_table() -> list[dict[str, object]]:
    """The least coverage of intervals of success rates, over a fine grid of rates."""
    grid = np.linspace(0.001, 0.999, 999)
    return [
        {
            "trials": trials,
            **{m: round(min(covered(trials, p, m) for p in grid), 4) for m in ("exact", "Wilson")},
        }
        for trials in SIZES
    ]


def coverage_rows(
    name: str, loads: Loads, samples: int, failures: float = 0.0
) -> list[dict[str, object]]:
    """Coverage of intervals of mean indicators: a row for each success rate."""
    rows = []
    for rate in RATES:
        row: dict[str, object] = {"loads": name, "rate": rate}
        for trials in SIZES:
            found = coverage(loads, trials, rate, samples=samples, seed=1, failures=failures)
            known = found.covered if found.shown >= SELDOM else None
            row[str(trials)] = [None if known is None else round(known, 4), round(found.shown, 3)]
        rows.append(row)
    return rows


def false_claims(name: str, rate: float, sizes: Sequence[int], boards: int) -> dict[str, object]:
    """How many boards of models alike call some model better; on tasks or overall, and overall."""
    rng = np.random.default_rng(2)
    any_task = overall = 0
    start = time.perf_counter()
    for _ in range(boards):
        rates = np.full((TASKS, MODELS), rate)
        made = rankings(board(rng, rates, sizes, [LOADS[name]] * MODELS))
        claims = [bool(ranking.better.any()) for ranking in made]
        any_task += any(claims)
        overall += claims[-1]
    return {
        "loads": name,
        "rate": rate,
        "trials": "4-64" if sizes is MIXED else sizes[0],
        "boards": boards,
        "false": round(any_task / boards, 4),
        "false_overall": round(overall / boards, 4),
        "seconds": round((time.perf_counter() - start) / boards, 3),
    }


def power(rate: float, rise: float, trials: int, boards: int) -> dict[str, object]:
    """How often a model that is better everywhere is called better than another."""
    rng = np.random.default_rng(3)
    rates = np.full((TASKS, MODELS), rate)
    rates[:, 0] += rise
    task = overall = 0.0
    for _ in range(boards):
        made = rankings(board(rng, rates, [trials] * MODELS, [LOADS["lognormal, sigma 0.8"]] * 12))
        task += float(np.mean([ranking.better[0, 1:] for ranking in made[:-1]])) / boards
        overall += float(made[-1].better[0, 1:].mean()) / boards
    return {
        "rate": rate,
        "rise": rise,
        "trials": trials,
        "min_detectable_effect_per_task": round(task, 3),
        "overall": round(overall, 3),
    }


def show(title: str, rows: Sequence[dict[str, object]]) -> None:
    """Prints a table."""
    names = list(rows[0])
    lines = [names, *([_text(row[name]) for name in names] for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(names))]
    sys.stdout.write(f"\n{title}\n")
    for line in lines:
        cells = [cell.ljust(w) for cell, w in zip(line, widths, strict=True)]
        sys.stdout.write("  ".join(cells).rstrip() + "\n")
    sys.stdout.flush()


def _text(value: object) -> str:
    if isinstance(value, list):
        held, shown = value
        return "-" if held is None else f"{100 * held:.1f} ({100 * shown:.0f})"
    return str(value)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--samples", type=int, default=2000, help="Samples of each interval")
    parser.add_argument("--boards", type=int, default=200, help="Boards of each kind")
    given = parser.parse_args()
    result: dict[str, object] = {"rates": rates_table()}
    show("Intervals of success rates: least coverage at any rate", rates_table())
    means = [r for name, loads in LOADS.items() for r in coverage_rows(name, loads, given.samples)]
    moved = coverage_rows(
        "failures up to 8", LOADS["lognormal, sigma 0.8"], given.samples, failures=8.0
    )
    result["means"] = [*means, *moved]
    known = [
        held
        for row in [*means, *moved]
        for held, _ in (row[str(n)] for n in SIZES)  # type: ignore[misc]
        if held is not None
    ]
    result["least_coverage"] = min(known)
    show(
        "Intervals of mean indicators: how often they hold, % (and are shown, %: with at least "
        f"{MIN_SUCCESSES} successes); least {100 * min(known):.1f} %",
        [*means, *moved],
    )
    result["outside"] = coverage_rows("10 % at 1500, others 50-200", RARE, given.samples)
    show("Outside the promise: one success in ten is ten times as good", result["outside"])  # type: ignore[arg-type]
    claims = [
        false_claims(name, rate, [trials] * MODELS, given.boards)
        for name in CLAIMED
        for rate, trials in ((0.1, 64), (0.3, 64), (0.6, 64), (1.0, 64), (0.6, 8), (0.6, 256))
    ]
    claims += [false_claims(name, 0.3, MIXED, given.boards) for name in CLAIMED]
    result["claims"] = claims
    show(f"{MODELS} models alike on {TASKS} tasks: boards that call one better", claims)
    result["power"] = [
        power(rate, rise, trials, max(10, given.boards // 10))
        for trials in (16, 64, 256)
        for rate in (0.1, 0.3)
        for rise in (0.1, 0.2, 0.3, 0.4)
    ]
    show("One model better than eleven: how often it is called so", result["power"])  # type: ignore[arg-type]
    keep(result, given.json)


if __name__ == "__main__":
    main()
