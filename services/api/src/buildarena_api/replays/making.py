"""Replays of this process: each made once from what is kept, and remembered."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from hashlib import sha256
from typing import Any, Final

from buildarena_api.http.codes import ErrorCode
from buildarena_api.http.etags import Answer, ResponseCache
from buildarena_api.http.problems import ProblemError
from buildarena_api.job_records import missing
from buildarena_api.replays.views import replay_view
from buildarena_backend.agents.turn_views import Transcripts
from buildarena_backend.catalog.tracks import EXTERNAL_WORKFLOW
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.replays.chapters import Replay
from buildarena_backend.replays.from_document import replay_of_document
from buildarena_backend.replays.from_turns import NO_BUILDING, replay_of_turns
from buildarena_backend.trials.scoring import drawn_for
from buildarena_benchmark import Task
from buildarena_geometry import DocumentError, Machine

MAX_CACHED_BYTES: Final = 64 << 20
"""Replays in memory; one of a usual session has 50 kB. They are not kept as artifacts: another
version of the geometry library may tell more, and none takes longer to make than to fetch."""

Turns = Sequence[Mapping[str, Any]]


class Replays:
    """Makes replays of jobs.

    Args:
        context: The process' connections.
    """

    def __init__(self, context: Context) -> None:
        self._artifacts = context.artifacts
        self._jobs = context.store.jobs
        self._tasks = context.tasks
        self._transcripts = Transcripts(context.store, context.artifacts)
        self._answers = ResponseCache(MAX_CACHED_BYTES)

    def answer(self, job: Job) -> Answer:
        """How the job's machine came about.

        Raises:
            ProblemError: Nothing was done yet.
        """
        transcript = self._transcripts.read(job)
        if transcript is None:
            raise missing(job.id, "turns")
        kept = self._jobs.artifacts(job.id)
        names = (kept.get("machine"), kept.get("transcript"), sha256(transcript).hexdigest())
        return self._answers.get_or_make(
            f"{names}", lambda: self._made(job, kept, json.loads(transcript)["turns"])
        )

    def _made(self, job: Job, kept: Mapping[str, str], turns: Turns) -> bytes:
        digest = kept.get("machine")
        if digest is None or self._goes_on(kept, turns):
            return _body(replay_of_turns(turns, self._task(job)), exact=None)
        document = json.loads(self._artifacts.get(digest))
        try:
            machine = Machine.from_document(document)
            if job.track_config.get("workflow") == EXTERNAL_WORKFLOW:
                replay = replay_of_turns(turns, self._task(job))
            else:
                replay = replay_of_document(document, turns)
        except DocumentError as error:
            detail = f"job {job.id} has a machine that this version does not read: {error}"
            raise ProblemError(ErrorCode.ARTIFACT_NOT_FOUND, detail) from error
        return _body(replay, exact=replay.complete and replay.machine == machine)

    def _task(self, job: Job) -> Task | None:
        task = self._tasks.exact(job.task, job.task_version)
        return None if task is None else drawn_for(job, task)

    def _goes_on(self, kept: Mapping[str, str], turns: Turns) -> bool:
        """Whether the session built on since its machine was kept."""
        digest = kept.get("transcript")
        known = 0 if digest is None else len(json.loads(self._artifacts.get(digest))["turns"])
        return any(turn["actions"] and turn["stage"] not in NO_BUILDING for turn in turns[known:])


def _body(replay: Replay, *, exact: bool | None) -> bytes:
    return replay_view(replay, exact=exact).model_dump_json().encode()
