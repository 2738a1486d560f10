"""Replays: built once from stored artifacts, cached, and their response models."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from hashlib import sha256
from typing import Any, Final, Literal

from pydantic import AliasChoices, AliasPath, ConfigDict, Field

from buildarena_api.http.etags import Answer, ResponseCache
from buildarena_api.job_records import machine_of, no_artifact
from buildarena_api.schemas import View
from buildarena_backend.agents.turn_views import Transcripts
from buildarena_backend.catalog.tracks import EXTERNAL_WORKFLOW
from buildarena_backend.jobs.job import Job
from buildarena_backend.process.context import Context
from buildarena_backend.replays.chapters import Replay
from buildarena_backend.replays.from_document import replay_of_log
from buildarena_backend.replays.from_turns import NO_BUILDING, replay_of_turns
from buildarena_backend.trials.scoring import find_task

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def _pose(part: str) -> AliasChoices:
    """Return where a block or a connector has a part of its pose."""
    return AliasChoices(*(AliasPath(f"world_from_{kind}", part) for kind in ("block", "connector")))


class PlacedPart(View):
    """A block, and where it would have been."""

    model_config = ConfigDict(validate_by_name=True)

    id: str
    module: str = Field(
        validation_alias=AliasPath("module", "name"), examples=["Small Wooden Block"]
    )
    position: Vector = Field(validation_alias=_pose("xyz"))
    """Position of its root point, world frame, units."""
    quaternion: Quaternion = Field(validation_alias=_pose("wxyz"))
    """World from block, (w, x, y, z)."""


class PartView(PlacedPart):
    """A part, and where it is after the step."""

    start: Vector | None = Field(default=None, validation_alias="start_xyz")
    """Start of a connector, world frame, units."""
    end: Vector | None = Field(default=None, validation_alias="end_xyz")
    """End of a connector."""
    flipped: bool = False
    """Whether a wheel's sense of rotation is reversed."""
    bindings: dict[str, list[str]]
    """Keys by action."""


def _changed(part: str) -> Any:
    """Return a field that a step's difference has."""
    return Field(validation_alias=AliasPath("difference", part))


class KeyPress(View):
    """A key that is held for a while."""

    time_s: float
    key: str
    hold_for_s: float


class StepView(View):
    """An action and its result."""

    turn: int | None
    """Index of its turn in the transcript; null for what the session did by itself."""
    action: str = Field(examples=["attach_block_to"])
    arguments: Any
    accepted: bool
    reason: str | None
    """Refusal class; null if it was accepted."""
    text: str | None
    """Reason of its refusal; null if it was accepted."""
    added: list[PartView] = _changed("added")
    moved: list[PartView] = _changed("moved")
    """Parts in another place than before."""
    removed: list[str] = _changed("removed")
    """Ids of removed parts."""
    rebound: list[PartView] = _changed("rebound")
    """Parts with other keys or sense of rotation."""
    control_sequence: list[KeyPress] | None = _changed("control_sequence")
    """All key presses, if the action changed them."""
    attempted: list[PlacedPart]
    """Blocks where a refused action would have put them, if that is known."""


class ChapterView(View):
    """The construction of one machine."""

    name: str
    kind: Literal["machine", "sub_structure", "assembly"]
    """An assembly is put together from copies of the sub-structures."""
    steps: list[StepView]


class ReplayView(View):
    """The construction of a job's machine, rebuilt by the geometry library."""

    chapters: list[ChapterView]
    """Sub-structures, then their assembly; each begins with nothing."""
    complete: bool
    """False where the steps are too many or too large: the last are left out."""
    exact: bool | None
    """Whether it ends in exactly the kept machine; null while none is kept."""


MAX_CACHED_BYTES: Final = 64 << 20
"""Replays in memory; one of a usual session has 50 kB. They are not kept as artifacts: another
version of the geometry library may add details, and none takes longer to make than to fetch."""

Turns = Sequence[Mapping[str, Any]]


class Replays:
    """Makes replays of jobs."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._transcripts = Transcripts(context.store, context.artifacts)
        self._answers = ResponseCache(MAX_CACHED_BYTES)

    def answer(self, job: Job) -> Answer:
        """Return the construction of the job's machine.

        Raises:
            ProblemError: Nothing was done yet.
        """
        transcript = self._transcripts.read(job)
        if transcript is None:
            raise no_artifact(job.id, "turns")
        files = self._context.store.jobs.artifacts(job.id)
        names = (files.get("machine"), files.get("transcript"), sha256(transcript).hexdigest())
        return self._answers.get_or_make(
            f"{names}", lambda: self._build(job, files, json.loads(transcript)["turns"])
        )

    def _build(self, job: Job, files: Mapping[str, str], turns: Turns) -> bytes:
        digest, task = files.get("machine"), find_task(job, self._context.tasks)
        if digest is None or self._goes_on(files, turns):
            return _body(replay_of_turns(turns, task), exact=None)
        machine = machine_of(self._context, digest, job)
        is_external = job.track_config.get("workflow") == EXTERNAL_WORKFLOW
        replay = replay_of_turns(turns, task) if is_external else replay_of_log(machine, turns)
        return _body(replay, exact=replay.complete and replay.machine == machine)

    def _goes_on(self, files: Mapping[str, str], turns: Turns) -> bool:
        """Return whether the session has built further since its machine was stored."""
        digest = files.get("transcript")
        count = (
            0 if digest is None else len(json.loads(self._context.artifacts.get(digest))["turns"])
        )
        return any(turn["actions"] and turn["stage"] not in NO_BUILDING for turn in turns[count:])


def _body(replay: Replay, *, exact: bool | None) -> bytes:
    content = {"chapters": replay.chapters, "complete": replay.complete, "exact": exact}
    return ReplayView.model_validate(content).model_dump_json().encode()
