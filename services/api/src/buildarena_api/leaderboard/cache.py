"""The boards of this process: summaries of cells, and answers as long as they are true."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from buildarena_api.http.etags import Answer
from buildarena_api.http.fair_cache import FairCache
from buildarena_api.leaderboard.cells import Cells, Shown
from buildarena_backend.boards.reading import Boards
from buildarena_backend.boards.trials import CellId, TrialFilter
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_benchmark import Task
from buildarena_benchmark.leaderboard import Board, BoardQuery, EndedJob, Tally

MAX_CACHED_ANSWERS: Final = 256
"""Answers in memory at most; one of a full board is about 200 kB."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What a board is asked for.

    Attributes:
        track: The track.
        query: Which tasks, models and times.
        sweeps: Ids of sweeps, if only jobs of these count.
        members: How many jobs these sweeps have: answers from before one had more are not true.
        asked_by: Whose share of the cached answers it takes; the answer is the same for all.
    """

    track: str
    query: BoardQuery
    sweeps: frozenset[str] | None = None
    members: int = 0
    asked_by: str = field(default="", compare=False)

    @property
    def is_partial(self) -> bool:
        """Whether only some jobs of a cell may count, so that no kept summary tells."""
        return (self.sweeps, self.query.since, self.query.until) != (None, None, None)

    def filter(self) -> TrialFilter:
        """The same for a query of jobs."""
        return TrialFilter(
            track=self.track,
            tasks=self.query.tasks,
            models=self.query.models,
            sweeps=self.sweeps,
            since=self.query.since,
            until=self.query.until,
        )


class BoardCache:
    """Keeps summaries of every cell up to date, and answers as long as they are true.

    Each question first asks the database what changed since the last one, which is one indexed
    look-up; nothing that a question is answered with is older than the question.

    Args:
        boards: Where cells, ended jobs and their changes are read.
        catalogue: Where tasks are read, when one was uploaded.
    """

    def __init__(self, boards: Boards, catalogue: TaskCatalog) -> None:
        self._boards = boards
        self._catalogue = catalogue
        self._task_versions: int | None = None
        self._tasks: Mapping[str, Task] = {}
        self._lock = threading.Lock()
        self._cells = Cells(boards.cells)
        self._answers: FairCache[tuple[Question, str], tuple[int, Answer]] = FairCache(
            MAX_CACHED_ANSWERS
        )

    def tracks(self, sweeps: frozenset[str] | None = None) -> list[str]:
        """Tracks with ended jobs.

        Args:
            sweeps: Only tracks with a job of one of these; all by default.
        """
        with self._lock:
            self._refresh()
            found = self._cells.tracks()
        if sweeps is None:
            return found
        return [
            track for track in found if self._boards.any_of(TrialFilter(track=track, sweeps=sweeps))
        ]

    def known_models(self, names: Iterable[str]) -> frozenset[str]:
        """Those of some models that have an ended job, as of the last question."""
        with self._lock:
            return frozenset(names) & self._cells.models()

    def tasks(self) -> Mapping[str, Task]:
        """Every task by name in its newest version, as of the last question."""
        with self._lock:
            if self._task_versions is None:
                self._refresh()
            return self._tasks

    def answer(self, question: Question, kind: str, render: Callable[[Board], bytes]) -> Answer:
        """The rendered board of a track.

        Args:
            question: What the board is made of.
            kind: Names the rendering: one kind is always rendered alike.
            render: Makes the body; called only when there is no true answer in memory.
        """
        return self._answer(
            question, kind, lambda shown: render(shown.board()), reads=question.is_partial
        )

    def answer_from_tallies(
        self,
        question: Question,
        kind: str,
        render: Callable[[Board, Mapping[CellId, tuple[str, Sequence[Tally]]]], bytes],
    ) -> Answer:
        """The same from the board and its cells, with model and tallies of each."""
        return self._answer(
            question, kind, lambda shown: render(shown.board(), shown.tallies()), reads=True
        )

    def inside(self, question: Question) -> dict[CellId, tuple[str, int]]:
        """The cells of a board: their models, and how many jobs of each were asked for."""
        return self._shown(question).inside()

    def trials(self, question: Question, cells: Sequence[CellId]) -> list[EndedJob]:
        """Single ended jobs of some of a board's cells."""
        wanted = question.filter()
        return self._boards.trials(wanted.within(cells))

    def scored_ids(self, question: Question, cells: Sequence[CellId]) -> list[str]:
        """Ids of scored jobs of some of a board's cells, in their order."""
        return self._boards.scored_ids(question.filter().within(cells))

    def _answer(
        self, question: Question, kind: str, render: Callable[[Shown], bytes], *, reads: bool
    ) -> Answer:
        """A kept answer, or a new one; when making it reads jobs, others need not wait for it."""
        key = (question, kind)
        with self._lock:
            self._refresh()
            generation = self._cells.generation(question.track)
            kept = self._answers.get(key)
            if kept is not None and kept[0] == generation:
                return kept[1]
            shown = self._cells.shown(question)
            if not question.is_partial:
                shown.summarise()
            if not reads:
                # Whoever asks the same meanwhile gets this answer.
                return self._keep(key, generation, render(shown))
        body = render(shown)
        with self._lock:
            return self._keep(key, generation, body)

    def _keep(self, key: tuple[Question, str], generation: int, body: bytes) -> Answer:
        answer = Answer.of(body)
        self._answers.put(key, (generation, answer), who=key[0].asked_by)
        return answer

    def _shown(self, question: Question) -> Shown:
        with self._lock:
            self._refresh()
            return self._cells.shown(question)

    def _refresh(self) -> None:
        task_versions = self._cells.refresh()
        if task_versions != self._task_versions:
            self._tasks, self._task_versions = self._catalogue.newest(), task_versions
            tasks = self._tasks.values()
            self._cells.use(
                {task.name: task.version for task in tasks},
                {task.name: task.difficulty for task in tasks if task.difficulty},
            )
