"""The boards of this process: fed with what changed, answered from memory."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping
from typing import Final

from buildarena_api.http.etags import Answer
from buildarena_benchmark import Task
from buildarena_benchmark.leaderboard import Board, BoardQuery, EndedJob, TrackBoard
from buildarena_pipeline.catalog.tasks import TaskCatalog
from buildarena_store import Boards

KEPT_ANSWERS: Final = 256
"""Answers in memory at most; one of a full board is about 200 kB."""


class BoardCache:
    """Keeps every track's board up to date and its answers as long as they are true.

    Each question first asks the database what changed since the last one, which is one indexed
    look-up; nothing that a question is answered with is older than the question.

    Args:
        boards: Where ended jobs and their changes are read.
        catalogue: Where tasks are read, when one was uploaded.
    """

    def __init__(self, boards: Boards, catalogue: TaskCatalog) -> None:
        self._boards = boards
        self._catalogue = catalogue
        self._task_versions: int | None = None
        self._tasks: Mapping[str, Task] = {}
        self._lock = threading.Lock()
        self._mark: int | None = None
        self._tracks: dict[str, TrackBoard] = {}
        self._track_of: dict[str, str] = {}
        self._generations: dict[str, int] = {}
        self._answers: OrderedDict[tuple[str, BoardQuery, str], tuple[int, Answer]] = OrderedDict()

    def tracks(self, jobs: Collection[str] | None = None) -> list[str]:
        """Tracks with ended jobs.

        Args:
            jobs: Only tracks with one of these; all by default.
        """
        with self._lock:
            self._refresh()
            if jobs is not None:
                return sorted({self._track_of[job] for job in jobs if job in self._track_of})
            return sorted(track for track, board in self._tracks.items() if len(board))

    def tasks(self) -> Mapping[str, Task]:
        """Every task by name in its newest version, as of the last question."""
        with self._lock:
            if self._task_versions is None:
                self._refresh()
            return self._tasks

    def answer(
        self, track: str, query: BoardQuery, kind: str, render: Callable[[Board], bytes]
    ) -> Answer:
        """The rendered board of a track.

        Args:
            track: The track.
            query: What the board is made of.
            kind: Names the rendering: one kind is always rendered alike.
            render: Makes the body; called only when there is no true answer in memory.
        """
        return self.answer_from(track, query, kind, lambda board: render(board.board(query)))

    def answer_from(
        self, track: str, query: BoardQuery, kind: str, render: Callable[[TrackBoard], bytes]
    ) -> Answer:
        """The same from all trials of a track; they do not change while it is made."""
        with self._lock:
            self._refresh()
            generation = self._generations.get(track, 0)
            key = (track, query, kind)
            kept = self._answers.get(key)
            if kept is not None and kept[0] == generation:
                self._answers.move_to_end(key)
                return kept[1]
            body = render(self._track(track))
            answer = Answer.of(body)
            self._answers[key] = (generation, answer)
            self._answers.move_to_end(key)
            while len(self._answers) > KEPT_ANSWERS:
                self._answers.popitem(last=False)
            return answer

    def trials(self, track: str, query: BoardQuery) -> list[EndedJob]:
        """The ended jobs that a board is made of."""
        with self._lock:
            self._refresh()
            return list(self._track(track).trials(query))

    def _refresh(self) -> None:
        feed = self._boards.feed(self._mark)
        changed: set[str] = set()
        if feed.task_versions != self._task_versions:
            self._tasks, self._task_versions = self._catalogue.newest(), feed.task_versions
            changed.update(self._tracks)
            for board in self._tracks.values():
                board.use(*self._known())
        for trial in feed.put:
            if self._track(trial.track).put(trial):
                changed.add(trial.track)
            self._track_of[trial.job_id] = trial.track
        for job_id in feed.gone:
            track = self._track_of.pop(job_id, None)
            if track is not None and self._track(track).remove(job_id):
                changed.add(track)
        for track in changed:
            self._generations[track] = self._generations.get(track, 0) + 1
        self._mark = feed.mark

    def _track(self, track: str) -> TrackBoard:
        if track not in self._tracks:
            self._tracks[track] = TrackBoard(*self._known())
        return self._tracks[track]

    def _known(self) -> tuple[dict[str, str], dict[str, Mapping[str, int]]]:
        """Versions and difficulty weights of the tasks."""
        tasks = self._tasks.values()
        return (
            {task.name: task.version for task in tasks},
            {task.name: task.difficulty for task in tasks if task.difficulty},
        )
