"""The board of one track: kept up to date trial by trial, summarised when it is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from buildarena_benchmark.flags import Reading
from buildarena_benchmark.leaderboard.cells import Cell, summarise
from buildarena_benchmark.leaderboard.ended_jobs import EndedJob
from buildarena_benchmark.leaderboard.overall import OverallRow, Weights, overall_rows
from buildarena_benchmark.leaderboard.standings import KeptTests, Standing, standings

CellKey = tuple[str, str, str]
"""Task, task version, configuration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardQuery:
    """Which trials a board is made of. None means all.

    Attributes:
        tasks: Task names.
        models: Model names.
        jobs: Ids of jobs.
        since: Only jobs that ended then or later.
        until: Only jobs that ended before.
        reading: How flags are read.
        overall: Tasks that the overall ranking is over, as far as they are on the board.
    """

    tasks: frozenset[str] | None = None
    models: frozenset[str] | None = None
    jobs: frozenset[str] | None = None
    since: datetime | None = None
    until: datetime | None = None
    reading: Reading = Reading.OURS
    overall: frozenset[str] | None = None

    def holds(self, trial: EndedJob) -> bool:
        """Whether a trial is among the jobs, and ended in the time, that were asked for."""
        if self.jobs is not None and trial.job_id not in self.jobs:
            return False
        if self.since is None and self.until is None:
            return True
        ended = trial.finished_at
        if ended is None:
            return False
        return (self.since is None or ended >= self.since) and (
            self.until is None or ended < self.until
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RankedCell:
    """A cell with its place on its task; places are None without counted trials."""

    cell: Cell
    rank: int | None
    rank_low: int | None
    rank_high: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskBoard:
    """All configurations on one version of one task, the best first.

    Attributes:
        outdated: Ended jobs of other versions of the task, which are left out.
    """

    task: str
    version: str
    outdated: int
    rows: Sequence[RankedCell]


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A track's boards, one for each task, and the ranking over them."""

    tasks: Sequence[TaskBoard]
    overall: Sequence[OverallRow]


class TrackBoard:
    """The trials of one track. Summaries of cells are kept until one of their trials changes.

    Not safe for use from several threads at once.

    Args:
        versions: Current version of each known task; of another task the newest one counts.
        weights: Difficulty weights by task.
    """

    def __init__(self, versions: Mapping[str, str], weights: Weights) -> None:
        self._versions = versions
        self._weights = weights
        self._cells: dict[CellKey, dict[str, EndedJob]] = {}
        self._places: dict[str, CellKey] = {}
        self._summaries: dict[tuple[CellKey, Reading], Cell] = {}
        self._tests = KeptTests()

    def use(self, versions: Mapping[str, str], weights: Weights) -> None:
        """Takes other tasks for known from now on; arguments as for the constructor."""
        self._versions, self._weights = versions, weights

    def put(self, trial: EndedJob) -> bool:
        """Adds or replaces a trial; returns whether anything changed."""
        key = (trial.task, trial.task_version, trial.configuration)
        place = self._places.get(trial.job_id)
        if place is not None and self._cells[place][trial.job_id] == trial:
            return False
        if place is not None and place != key:
            self.remove(trial.job_id)
        self._places[trial.job_id] = key
        self._cells.setdefault(key, {})[trial.job_id] = trial
        self._forget(key)
        return True

    def remove(self, job_id: str) -> bool:
        """Takes a trial out; returns whether it was there."""
        key = self._places.pop(job_id, None)
        if key is None:
            return False
        del self._cells[key][job_id]
        if not self._cells[key]:
            del self._cells[key]
        self._forget(key)
        return True

    def __len__(self) -> int:
        return len(self._places)

    def trials(self, query: BoardQuery) -> Iterable[EndedJob]:
        """The trials that a query's board is made of, flagged ones included."""
        for keys in self._chosen(query)[0].values():
            for key in keys:
                yield from filter(query.holds, self._cells[key].values())

    def board(self, query: BoardQuery) -> Board:
        """Summarises and ranks what the query asks for."""
        chosen, outdated = self._chosen(query)
        cells: dict[str, dict[str, Cell]] = {}
        for (task, _), keys in chosen.items():
            row = {key[2]: self._summary(key, query) for key in keys}
            cells[task] = {name: cell for name, cell in row.items() if cell is not None}

        def ranked(task: str) -> bool:
            return query.overall is None or task in query.overall

        found = standings(cells, ranked, self._tests)
        boards = [
            TaskBoard(
                task=task,
                version=version,
                outdated=outdated.get(task, 0),
                rows=_ranked(cells[task], found.tasks.get(task)),
            )
            for task, version in chosen
            if cells[task]
        ]
        filled = {task: row for task, row in cells.items() if row and ranked(task)}
        return Board(tasks=boards, overall=overall_rows(filled, found.overall, self._weights))

    def _chosen(
        self, query: BoardQuery
    ) -> tuple[dict[tuple[str, str], list[CellKey]], dict[str, int]]:
        """Cells by task and version, and how many trials other versions have."""
        by_task: dict[str, dict[str, list[CellKey]]] = {}
        for key, trials in self._cells.items():
            model = next(iter(trials.values())).model
            if query.tasks is not None and key[0] not in query.tasks:
                continue
            if query.models is not None and model not in query.models:
                continue
            by_task.setdefault(key[0], {}).setdefault(key[1], []).append(key)
        chosen: dict[tuple[str, str], list[CellKey]] = {}
        outdated: dict[str, int] = {}
        known = list(self._versions)
        for task in sorted(by_task, key=lambda t: (_place(known, t), t)):
            versions = by_task[task]
            version = self._versions.get(task, "")
            if version not in versions:
                version = max(versions, key=lambda v: (self._newest(versions[v]), v))
            chosen[task, version] = sorted(versions[version])
            outdated[task] = sum(
                sum(map(query.holds, self._cells[key].values()))
                for v in versions
                if v != version
                for key in versions[v]
            )
        return chosen, outdated

    def _newest(self, keys: Sequence[CellKey]) -> float:
        return max(
            trial.finished_at.timestamp() if trial.finished_at else 0.0
            for key in keys
            for trial in self._cells[key].values()
        )

    def _summary(self, key: CellKey, query: BoardQuery) -> Cell | None:
        trials = list(self._cells[key].values())
        inside = [trial for trial in trials if query.holds(trial)]
        if not inside:
            return None
        if len(inside) < len(trials):
            return summarise(inside, reading=query.reading)
        place = (key, query.reading)
        if place not in self._summaries:
            self._summaries[place] = summarise(trials, reading=query.reading)
        return self._summaries[place]

    def _forget(self, key: CellKey) -> None:
        for reading in Reading:
            self._summaries.pop((key, reading), None)


def _ranked(cells: Mapping[str, Cell], standing: Standing | None) -> list[RankedCell]:
    rows = [
        RankedCell(cell=cell, rank=None, rank_low=None, rank_high=None)
        for cell in sorted(cells.values(), key=lambda c: (c.model, c.configuration))
        if not cell.trials
    ]
    if standing is None:
        return rows
    ranking, counted = standing.ranking, [cells[name] for name in standing.names]
    order = sorted(
        range(len(counted)),
        key=lambda i: (
            ranking.rank[i],
            ranking.mean_rank[i],
            -(counted[i].success_rate or 0.0),
            counted[i].model,
            counted[i].configuration,
        ),
    )
    return [
        RankedCell(
            cell=counted[i],
            rank=int(ranking.rank[i]),
            rank_low=int(ranking.low[i]),
            rank_high=int(ranking.high[i]),
        )
        for i in order
    ] + rows


def _place(known: Sequence[str], task: str) -> int:
    return known.index(task) if task in known else len(known)
