"""Summaries of cells in memory, kept until one of their jobs changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from buildarena_benchmark.leaderboard import (
    Board,
    BoardQuery,
    Cell,
    CellHead,
    CellKey,
    ChosenCells,
    Tally,
    TestCache,
    choose_cells,
    ranked_board,
)
from buildarena_store import BoardCells, CellId, CellRecord, Mark, TrialFilter

Weights = Mapping[str, Mapping[str, int]]


class Asked(Protocol):
    """What a board is asked for, as far as cells are concerned."""

    @property
    def track(self) -> str:
        """The track."""

    @property
    def query(self) -> BoardQuery:
        """Which tasks, models and times."""

    @property
    def is_partial(self) -> bool:
        """Whether only some jobs of a cell may count."""

    def filter(self) -> TrialFilter:
        """The same for a query of jobs."""


class Cells:
    """Every cell's head, and summaries as far as they were asked for.

    Not safe for use from several threads at once; what `shown` returns is.
    """

    def __init__(self, store: BoardCells) -> None:
        self._store = store
        self._mark: Mark | None = None
        self._versions: Mapping[str, str] = {}
        self._weights: Weights = {}
        self._heads: dict[str, dict[CellKey, CellRecord]] = {}
        self._summaries: dict[CellId, Cell] = {}
        self._generations: dict[str, int] = {}
        self._tests = TestCache()

    def refresh(self) -> int:
        """Takes in what changed; returns how many versions of tasks were ever uploaded."""
        feed = self._store.feed(self._mark)
        changed = {record.id.track for record in feed.cells}
        if feed.whole:
            changed.update(self._heads)
            self._heads.clear()
            self._summaries.clear()
        for record in feed.cells:
            self._take(record)
        for track in changed:
            self._generations[track] = self._generations.get(track, 0) + 1
        self._mark = feed.mark
        return feed.task_versions

    def use(self, versions: Mapping[str, str], weights: Weights) -> None:
        """Takes these tasks for known from now on.

        Args:
            versions: Current version of each; of another task the newest one counts.
            weights: Difficulty weights by task.
        """
        self._versions, self._weights = versions, weights
        for track in self._heads:
            self._generations[track] = self._generations.get(track, 0) + 1

    def tracks(self) -> list[str]:
        """Tracks with ended jobs."""
        return sorted(track for track, heads in self._heads.items() if heads)

    def models(self) -> set[str]:
        """Models with ended jobs, of all tracks."""
        return {head.model for heads in self._heads.values() for head in heads.values()}

    def generation(self, track: str) -> int:
        """A number that is another one after each change of the track."""
        return self._generations.get(track, 0)

    def shown(self, asked: Asked) -> Shown:
        """The cells of a board."""
        heads = self._heads.get(asked.track, {})
        given = [CellHead(key=key, model=r.model, newest=r.newest) for key, r in heads.items()]
        chosen = choose_cells(given, self._versions, asked.query)
        keys = [key for keys in (chosen.shown, chosen.outdated) for k in keys.values() for key in k]
        return Shown(
            asked=asked,
            chosen=chosen,
            heads={key: heads[key] for key in keys},
            weights=self._weights,
            tests=self._tests,
            store=self._store,
            kept=self,
        )

    def summaries(self, ids: Sequence[CellId]) -> dict[CellId, Cell]:
        """Summaries of whole cells; those that are not known are made."""
        missing = [id_ for id_ in ids if id_ not in self._summaries]
        self._summaries.update(self._store.summaries(missing))
        return {id_: self._summaries[id_] for id_ in ids if id_ in self._summaries}

    def _take(self, record: CellRecord) -> None:
        id_, heads = record.id, self._heads.setdefault(record.id.track, {})
        asked_for = self._summaries.pop(id_, None)
        if asked_for is not None and record.summary is not None:
            self._summaries[id_] = record.summary
        if record.jobs:
            heads[id_[1:]] = replace(record, summary=None)
        else:
            heads.pop(id_[1:], None)


@dataclass(slots=True, kw_only=True)
class Shown:
    """The cells of one board, as they were when it was asked for."""

    asked: Asked
    chosen: ChosenCells
    heads: Mapping[CellKey, CellRecord]
    weights: Weights
    tests: TestCache
    store: BoardCells
    kept: Cells
    _summaries: Mapping[CellId, Cell] = field(default_factory=dict)
    _made: Mapping[CellId, CellRecord] | None = None

    def summarise(self) -> None:
        """Takes the summaries of whole cells; only while nobody else uses the cells."""
        ids = [
            CellId(self.asked.track, *key) for keys in self.chosen.shown.values() for key in keys
        ]
        self._summaries = self.kept.summaries(ids)

    def board(self) -> Board:
        """Summarises and ranks what was asked for."""
        query, track = self.asked.query, self.asked.track
        outdated = {
            task: sum(self._jobs(CellId(track, *key)) for key in keys)
            for task, keys in self.chosen.outdated.items()
        }
        return ranked_board(
            self.chosen,
            lambda key: self._cell(CellId(track, *key)),
            outdated,
            overall=query.overall,
            weights=self.weights,
            tests=self.tests,
        )

    def inside(self) -> dict[CellId, tuple[str, int]]:
        """Models of the board's cells, and how many jobs of each were asked for."""
        ids = [
            CellId(self.asked.track, *key) for keys in self.chosen.shown.values() for key in keys
        ]
        found = {id_: (self.heads[id_[1:]].model, self._jobs(id_)) for id_ in ids}
        return {id_: one for id_, one in found.items() if one[1]}

    def tallies(self) -> dict[CellId, tuple[str, Sequence[Tally]]]:
        """Models and tallies of the board's cells."""
        ids = list(self.inside())
        if self.asked.is_partial:
            records = [self._part()[id_] for id_ in ids]
        else:
            records = list(self.store.read(ids))
        return {record.id: (record.model, record.tallies) for record in records}

    def _ids(self) -> list[CellId]:
        shown = self.chosen.shown.values()
        return [CellId(self.asked.track, *key) for keys in shown for key in keys]

    def _jobs(self, id_: CellId) -> int:
        if not self.asked.is_partial:
            return self.heads[id_[1:]].jobs
        record = self._part().get(id_)
        return record.jobs if record else 0

    def _cell(self, id_: CellId) -> Cell | None:
        if not self.asked.is_partial:
            return self._summaries.get(id_)
        record = self._part().get(id_)
        return None if record is None else record.summarise()

    def _part(self) -> Mapping[CellId, CellRecord]:
        """Cells of just the jobs that were asked for."""
        if self._made is None:
            wanted = self.asked.filter()
            if wanted.sweeps is None:
                ids = [CellId(self.asked.track, *key) for key in self.heads]
                kept = self.store.read(ids, details=True)
                parts = (record.between(wanted.since, wanted.until) for record in kept)
                records = [record for record in parts if record.jobs]
            else:
                records = self.store.of(wanted)
            self._made = {record.id: record for record in records}
        return self._made
