"""Comparisons of all models on a board, as one family of tests.

A board of twelve models and nine tasks compares 594 pairs, and twelve models that are alike would
show some pair apart on most boards if each were tested for itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from buildarena_benchmark.leaderboard.cells import Cell
from buildarena_benchmark.statistics.permutation import PairTests, pair_tests
from buildarena_benchmark.statistics.ranking import Ranking, adjusted, combined, rank_models

MAX_CACHED_TESTS: Final = 256
"""Tasks whose tests are cached: the present ones, and those of recent filters."""
MAX_CACHED_PAIRS: Final = 100_000
"""Tests of single pairs that are cached, and as many older ones: some 200 bytes each."""

PairTest = tuple[float, float, bool]
"""Evidence, p-value, and whether anything varies, as in `PairTests`."""

Row = Mapping[str, Cell]
"""Cells by configuration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """Configurations with counted trials, and how they rank."""

    names: Sequence[str]
    ranking: Ranking

    @property
    def places(self) -> Mapping[str, tuple[int, int, float]]:
        """Rank, upper end of the place's interval, and mean rank, by name."""
        ranking = self.ranking
        figures = ranking.rank.tolist(), ranking.high.tolist(), ranking.mean_rank.tolist()
        return dict(zip(self.names, zip(*figures, strict=True), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Standings:
    """The standings of a board.

    Attributes:
        tasks: Standing by task, of those with counted trials.
        overall: Over the ranked tasks, of the largest group that shared tasks connect; None
            without counted trials.
    """

    tasks: Mapping[str, Standing]
    overall: Standing | None


def standings(
    cells: Mapping[str, Row],
    ranked: Callable[[str], bool],
    tests: TestCache,
    is_baseline: Callable[[str], bool],
) -> Standings:
    """Rank configurations on each task and over the ranked ones; baselines take no part.

    The tests of the ranked tasks and of the ranking over them are one family; each other task is
    one by itself, so that an uploaded task takes no statistical power from the others.

    Args:
        cells: Cells by task and configuration.
        ranked: Whether a task belongs to the ranking over tasks.
        is_baseline: Whether a model is for comparison only.
    """
    counted = {}
    for task, row in cells.items():
        kept = {n: row[n] for n in sorted(row) if row[n].counted and not is_baseline(row[n].model)}
        if kept:
            counted[task] = kept
    tested = {task: tests.of(list(row.values())) for task, row in counted.items()}
    over = [task for task in counted if ranked(task)]
    p_values = {task: adjusted([tested[task]])[0] for task in counted if task not in over}
    family = [tested[task] for task in over]
    names = _largest_group([set(counted[task]) for task in over])
    overall = None
    if not names:
        own = adjusted(family)
    else:
        shared = {task: counted[task] for task in over if counted[task].keys() <= set(names)}
        together = _over_tasks(shared, tested, names)
        if len(shared) > 1:
            *own, last = adjusted([*family, together])
        else:
            # One task alone is its own ranking: its tests are not counted twice.
            own = adjusted(family)
            last = own[over.index(next(iter(shared)))]
        table = [[row.get(name) for name in names] for row in shared.values()]
        overall = Standing(names=names, ranking=rank_models(_figures(table), together, last))
    p_values |= dict(zip(over, own, strict=True))
    return Standings(
        tasks={
            task: Standing(
                names=list(row),
                ranking=rank_models(_figures([list(row.values())]), tested[task], p_values[task]),
            )
            for task, row in counted.items()
        },
        overall=overall,
    )


class TestCache:
    """Tests of all pairs of cells; one of cells with equal figures is not made twice.

    Memory is bounded, and no cell is kept alive: tests are found by the hashes of the figures.
    """

    def __init__(self) -> None:
        self._rows: dict[tuple[bytes, ...], PairTests] = {}
        # The least recently used tests are dropped.
        self._pairs: dict[tuple[bytes, bytes], PairTest] = {}
        self._older: dict[tuple[bytes, bytes], PairTest] = {}

    def of(self, cells: Sequence[Cell]) -> PairTests:
        """Return the tests of all pairs of cells, in the order of `itertools.combinations`."""
        key = tuple(cell.figures_hash for cell in cells)
        row_tests = self._rows.get(key)
        if row_tests is None:
            row_tests = self._test(cells)
            if len(self._rows) >= MAX_CACHED_TESTS:
                self._rows.clear()
            self._rows[key] = row_tests
        return row_tests

    def _test(self, cells: Sequence[Cell]) -> PairTests:
        pairs = list(combinations(cells, 2))
        names = [(a.figures_hash, b.figures_hash) for a, b in pairs]
        results = [self._lookup(name) for name in names]
        missing = [place for place, test in enumerate(results) if test is None]
        new_tests = pair_tests([(pairs[i][0].sample, pairs[i][1].sample) for i in missing])
        figures = new_tests.z.tolist(), new_tests.p_value.tolist(), new_tests.informative.tolist()
        for place, test in zip(missing, zip(*figures, strict=True), strict=True):
            results[place] = test
            self._keep(names[place], test)
        return PairTests.of(np.array(results, float).reshape(-1, 3).T)

    def _lookup(self, name: tuple[bytes, bytes]) -> PairTest | None:
        test = self._pairs.get(name)
        if test is None and (test := self._older.get(name)) is not None:
            self._keep(name, test)
        return test

    def _keep(self, name: tuple[bytes, bytes], test: PairTest) -> None:
        if len(self._pairs) >= MAX_CACHED_PAIRS:
            self._older, self._pairs = self._pairs, {}
        self._pairs[name] = test


def _largest_group(rows: Sequence[set[str]]) -> list[str]:
    """Return the names of the largest group that shared rows connect, sorted."""
    groups: list[set[str]] = []
    for row in rows:
        linked = [group for group in groups if group & row]
        groups = [row.union(*linked), *(group for group in groups if group not in linked)]
    return sorted(max(groups, key=lambda group: (len(group), sorted(group)), default=()))


def _over_tasks(
    rows: Mapping[str, Row], tested: Mapping[str, PairTests], names: Sequence[str]
) -> PairTests:
    """Return the tests of all pairs of names over the tasks that both have."""
    number, count = {name: place for place, name in enumerate(names)}, len(names)
    chosen = []
    for task, row in rows.items():
        own = np.array([number[name] for name in row], dtype=np.int64)
        first, second = (own[places] for places in np.triu_indices(len(own), 1))
        pairs = first * (2 * count - first - 1) // 2 + second - first - 1
        tests, own_tests = np.zeros((3, count * (count - 1) // 2)), tested[task]
        tests[1] = 1.0
        tests[:, pairs] = own_tests.z, own_tests.p_value, own_tests.informative
        chosen.append(PairTests.of(tests))
    return combined(chosen)


def _figures(table: Sequence[Sequence[Cell | None]]) -> tuple[np.ndarray, np.ndarray]:
    """Return success rates and mean indicators, each (T, M) float64; NaN without a cell."""
    success, indicator = (
        np.array([[_value(cell, name) for cell in row] for row in table])
        for name in ("success_rate", "indicator_mean")
    )
    return success, indicator


def _value(cell: Cell | None, name: str) -> float:
    return float("nan") if cell is None else float(getattr(cell, name) or 0.0)
