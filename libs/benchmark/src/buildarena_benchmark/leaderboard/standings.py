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
from buildarena_benchmark.statistics import (
    PairTests,
    Ranking,
    adjusted,
    combined,
    pair_tests,
    rank_models,
)

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Standings:
    """The standings of a board.

    Attributes:
        tasks: By task, of those that have counted trials.
        overall: Over the ranked tasks, of those who have counted trials on all; None when nobody
            has.
    """

    tasks: Mapping[str, Standing]
    overall: Standing | None


def standings(
    cells: Mapping[str, Row], ranked: Callable[[str], bool], tests: TestCache
) -> Standings:
    """Rank configurations on each task and over the ranked ones.

    The tests of the ranked tasks and of the ranking over them are one family; each other task is
    one by itself, so that an uploaded task takes no statistical power from the others.

    Args:
        cells: Cells by task and configuration.
        ranked: Whether a task belongs to the ranking over tasks.
        tests: What was tested before.
    """
    counted = {
        task: {name: cell for name, cell in row.items() if cell.counted}
        for task, row in cells.items()
    }
    counted = {task: row for task, row in counted.items() if row}
    tested = {task: tests.of(list(row.values())) for task, row in counted.items()}
    over = [task for task in counted if ranked(task)]
    complete = [name for name in _names(counted, over) if all(name in counted[t] for t in over)]
    together = _over_tasks(counted, tested, over, complete) if complete else None
    p_values = {task: adjusted([tested[task]])[0] for task in counted if task not in over}
    family = [tested[task] for task in over]
    overall = None
    if together is None:
        own = adjusted(family)
    else:
        if len(over) > 1:
            *own, last = adjusted([*family, together])
        else:
            # One task alone is its own ranking: its tests are not counted twice.
            own = adjusted(family)
            last = own[0][_places(counted[over[0]], complete)]
        table = [[counted[task][name] for name in complete] for task in over]
        overall = Standing(names=complete, ranking=rank_models(_figures(table), together, last))
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
        # Tests that were not asked for while as many others were are forgotten.
        self._pairs: dict[tuple[bytes, bytes], PairTest] = {}
        self._older: dict[tuple[bytes, bytes], PairTest] = {}

    def of(self, cells: Sequence[Cell]) -> PairTests:
        """Return the tests of all pairs of cells, in the order of `itertools.combinations`."""
        key = tuple(cell.figures_hash for cell in cells)
        row_tests = self._rows.get(key)
        if row_tests is None:
            row_tests = self._tested(cells)
            if len(self._rows) >= MAX_CACHED_TESTS:
                self._rows.clear()
            self._rows[key] = row_tests
        return row_tests

    def _tested(self, cells: Sequence[Cell]) -> PairTests:
        pairs = list(combinations(cells, 2))
        names = [(a.figures_hash, b.figures_hash) for a, b in pairs]
        results = [self._known(name) for name in names]
        missing = [place for place, test in enumerate(results) if test is None]
        made = pair_tests([(pairs[i][0].sample, pairs[i][1].sample) for i in missing])
        for place, *test in zip(
            missing,
            made.z.tolist(),
            made.p_value.tolist(),
            made.informative.tolist(),
            strict=True,
        ):
            results[place] = (test[0], test[1], test[2])
            self._keep(names[place], (test[0], test[1], test[2]))
        columns = np.array(results, float).reshape(-1, 3)
        return PairTests(
            z=columns[:, 0], p_value=columns[:, 1], informative=columns[:, 2].astype(bool)
        )

    def _known(self, name: tuple[bytes, bytes]) -> PairTest | None:
        test = self._pairs.get(name)
        if test is None and (test := self._older.get(name)) is not None:
            self._keep(name, test)
        return test

    def _keep(self, name: tuple[bytes, bytes], test: PairTest) -> None:
        if len(self._pairs) >= MAX_CACHED_PAIRS:
            self._older, self._pairs = self._pairs, {}
        self._pairs[name] = test


def _names(counted: Mapping[str, Row], tasks: Sequence[str]) -> list[str]:
    return sorted({name for task in tasks for name in counted[task]})


def _places(row: Row, complete: Sequence[str]) -> slice | list[int]:
    """Return where the pairs of complete configurations are among a task's pairs."""
    if list(row) == complete:
        return slice(None)
    number = {name: place for place, name in enumerate(row)}
    pairs = {pair: place for place, pair in enumerate(combinations(range(len(row)), 2))}
    return [pairs[number[a], number[b]] for a, b in combinations(complete, 2)]


def _over_tasks(
    counted: Mapping[str, Row],
    tested: Mapping[str, PairTests],
    over: Sequence[str],
    complete: Sequence[str],
) -> PairTests:
    chosen = []
    for task in over:
        places, tests = _places(counted[task], complete), tested[task]
        chosen.append(
            PairTests(
                z=tests.z[places],
                p_value=tests.p_value[places],
                informative=tests.informative[places],
            )
        )
    return combined(chosen)


def _figures(table: Sequence[Sequence[Cell]]) -> tuple[np.ndarray, np.ndarray]:
    """Success rates and mean indicators, each (T, M) float64."""
    success, indicator = (
        np.array([[float(getattr(cell, name) or 0.0) for cell in row] for row in table])
        for name in ("success_rate", "indicator_mean")
    )
    return success, indicator
