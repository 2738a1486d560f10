"""The boards of this process: cells in memory, and answers while they are valid."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from cachetools import LRUCache

from buildarena_api.http.etags import Answer
from buildarena_backend.boards.ended_jobs import Boards
from buildarena_backend.boards.tallies import CellRecord
from buildarena_backend.boards.trials import CellId, TrialFilter
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_benchmark import Task
from buildarena_benchmark.leaderboard import (
    Board,
    BoardQuery,
    CellHead,
    CellKey,
    ChosenCells,
    TestCache,
    choose_cells,
    ranked_board,
)

MAX_CACHED_ANSWERS: Final = 256
"""Answers in memory at most; one of a full board is about 200 kB."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """Selection of a board's rows.

    Attributes:
        sweeps: Ids of sweeps, if only jobs of these count.
        members: Number of jobs of these sweeps: answers from before one had more are outdated.
    """

    track: str
    query: BoardQuery
    sweeps: frozenset[str] | None = None
    members: int = 0

    @property
    def is_partial(self) -> bool:
        """Return whether only some jobs of a cell count, so that cached summaries do not apply."""
        return self.sweeps is not None

    def filter(self) -> TrialFilter:
        """Return the same for a query of jobs."""
        return TrialFilter(
            track=self.track,
            tasks=self.query.tasks,
            models=self.query.models,
            sweeps=self.sweeps,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownCells:
    """The cells of one board at the time of its request."""

    question: Question
    chosen: ChosenCells
    records: Mapping[CellKey, CellRecord]

    def inside(self) -> dict[CellId, CellRecord]:
        """Return the board's cells that have requested jobs."""
        cells = (self.records.get(key) for keys in self.chosen.shown.values() for key in keys)
        return {record.id: record for record in cells if record is not None}


class BoardCache:
    """Keeps every cell up to date in memory, and answers while they are valid.

    Each question first asks the database what changed since the last one, which is one indexed
    look-up; nothing that a question is answered with is older than the question.
    """

    def __init__(
        self, boards: Boards, catalogue: TaskCatalog, is_baseline: Callable[[str], bool]
    ) -> None:
        self._boards, self._catalogue, self._is_baseline = boards, catalogue, is_baseline
        self._lock = threading.Lock()
        self._mark: str | None = None
        self._records: dict[str, dict[CellKey, CellRecord]] = {}
        self._generations: Counter[str] = Counter()
        self._task_versions: int | None = None
        self._tasks: Mapping[str, Task] = {}
        self._tests = TestCache()
        self._answers: LRUCache[tuple[Question, str], tuple[int, Answer]] = LRUCache(
            MAX_CACHED_ANSWERS
        )

    def tracks(self, sweeps: frozenset[str] | None = None) -> dict[str, int]:
        """Return the number of ended jobs by track.

        Args:
            sweeps: Only jobs of these; all by default.
        """
        with self._lock:
            self._refresh()
            counts = {
                track: sum(record.jobs for record in records.values())
                for track, records in sorted(self._records.items())
                if records
            }
        return counts if sweeps is None else self._boards.by_track(TrialFilter(sweeps=sweeps))

    def known_models(self) -> frozenset[str]:
        """Return the models that have an ended job, as of the last request."""
        with self._lock:
            records = [cell for cells in self._records.values() for cell in cells.values()]
        return frozenset(record.model for record in records)

    def tasks(self) -> Mapping[str, Task]:
        """Return every task by name in its newest version, as of the last request."""
        with self._lock:
            if self._task_versions is None:
                self._refresh()
            return self._tasks

    def answer(self, question: Question, kind: str, render: Callable[[Board], bytes]) -> Answer:
        """Return the rendered board of a track.

        Args:
            kind: Names the rendering: one kind is always rendered alike.
            render: Makes the body; called only without a valid answer in memory.
        """
        key = (question, kind)
        with self._lock:
            self._refresh()
            generation = self._generations[question.track]
            cached = self._answers.get(key)
            if cached is not None and cached[0] == generation:
                return cached[1]
            shown = self._select(question)
            if not question.is_partial:
                # Equal requests meanwhile get this answer.
                return self._keep(key, generation, render(self._rank(shown)))
        # Making it reads jobs: others need not wait for it.
        body = render(self._rank(self._of_jobs(shown)))
        with self._lock:
            return self._keep(key, generation, body)

    def inside(self, question: Question) -> dict[CellId, CellRecord]:
        """Return the cells of a board that have requested jobs."""
        with self._lock:
            self._refresh()
            shown = self._select(question)
        return (self._of_jobs(shown) if question.is_partial else shown).inside()

    def scored_ids(self, question: Question, cells: Sequence[CellId]) -> list[str]:
        """Return the ids of scored jobs of some of a board's cells, in order."""
        return self._boards.scored_ids(replace(question.filter(), cells=cells))

    def _keep(self, key: tuple[Question, str], generation: int, body: bytes) -> Answer:
        answer = Answer.of(body)
        self._answers[key] = (generation, answer)
        return answer

    def _select(self, question: Question) -> ShownCells:
        records = self._records.get(question.track, {})
        heads = [CellHead(key=k, model=r.model, newest=r.newest) for k, r in records.items()]
        versions = {name: task.version for name, task in self._tasks.items()}
        chosen = choose_cells(heads, versions, question.query)
        groups = (*chosen.shown.values(), *chosen.outdated.values())
        return ShownCells(
            question=question,
            chosen=chosen,
            records={key: records[key] for keys in groups for key in keys},
        )

    def _rank(self, shown: ShownCells) -> Board:
        """Summarise and rank the requested cells."""
        records = shown.records
        outdated = {
            task: sum(records[key].jobs for key in keys if key in records)
            for task, keys in shown.chosen.outdated.items()
        }
        return ranked_board(
            shown.chosen,
            lambda key: records[key].summary if key in records else None,
            outdated,
            overall=shown.question.query.overall,
            tests=self._tests,
            is_baseline=self._is_baseline,
        )

    def _of_jobs(self, shown: ShownCells) -> ShownCells:
        """Return the same cells, of just the requested jobs."""
        records = self._boards.cells.of(shown.question.filter())
        return replace(shown, records={record.id[1:]: record for record in records})

    def _refresh(self) -> None:
        feed = self._boards.cells.feed(self._mark)
        changed = {record.id.track for record in feed.cells}
        if feed.complete:
            changed.update(self._records)
            self._records.clear()
        for record in feed.cells:
            records = self._records.setdefault(record.id.track, {})
            if record.jobs:
                records[record.id[1:]] = record
            else:
                records.pop(record.id[1:], None)
        if feed.task_versions != self._task_versions:
            self._tasks, self._task_versions = self._catalogue.newest(), feed.task_versions
            changed.update(self._records)
        self._generations.update(changed)
        self._mark = feed.mark
