"""Routes of the leaderboard, and the selection of its jobs."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Request
from pydantic import Field

from buildarena_api.access import CallerDep, limited
from buildarena_api.dependencies import Services, ServicesDep, Track
from buildarena_api.http.etags import Answer, conditional
from buildarena_api.http.problems import ErrorCode, invalid, require_each, unknown
from buildarena_api.leaderboard.cache import Question
from buildarena_api.leaderboard.views import Board, board_view
from buildarena_api.routes.verifications import request_verifications
from buildarena_api.schemas import Document, View
from buildarena_backend.boards.tallies import CellRecord
from buildarena_backend.boards.trials import CellId
from buildarena_backend.catalog.tracks import default_track
from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.leaderboard import Board as RankedBoard
from buildarena_benchmark.leaderboard import BoardQuery, Cell, TaskComparison, compare_models

DEFAULT_TRACK = (
    "Default: the standard track (what a sweep gets that names only tasks and models) once jobs of "
    "it have ended, otherwise the one with the most ended jobs"
)
MAX_SWEEPS = 50
NO_BOARD = Board(track=None, tracks=[], tasks=[])
Render = Callable[[RankedBoard, Board], bytes]
"""Maximum number of sweeps of one board."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """The selected track and jobs; the track is None when no job has ended.

    Attributes:
        tracks: All tracks that can be selected.
        question: The track with tasks, models and sweeps.
    """

    track: str | None
    tracks: list[str]
    question: Question


def select_board(
    services: ServicesDep,
    *,
    track: Annotated[Track | None, Query(description=DEFAULT_TRACK)] = None,
    task: Annotated[list[str] | None, Query(description="Only these tasks")] = None,
    category: Annotated[
        list[str] | None,
        Query(
            description="Only tasks of these categories; the overall ranking is over the built-in "
            "ones, or over what there is where none of these was played"
        ),
    ] = None,
    model: Annotated[list[str] | None, Query(description="Only these models")] = None,
    sweep: Annotated[
        list[str] | None,
        Query(max_length=MAX_SWEEPS, description="Only jobs of these sweeps, and their tracks"),
    ] = None,
) -> Selection:
    """Return the board that the parameters select.

    Raises:
        ProblemError: A track, task, category or model is unknown.
        NotFoundError: A sweep is unknown.
    """
    context, boards = services.context, services.boards
    sweeps = frozenset(sweep) if sweep else None
    members = sum(context.store.sweeps.size(id_) for id_ in sorted(sweeps or ()))
    ended = boards.tracks(sweeps)
    track = track_or_default(services, track, ended)
    tasks = boards.tasks()
    require_each("task", task, tasks)
    require_each("category", category, {entry.category for entry in tasks.values()})
    require_each("model", model, boards.known_models(), more=services.registry.models)
    chosen = None
    if task or category:
        chosen = frozenset(
            name
            for name, entry in tasks.items()
            if (not task or name in task) and (not category or entry.category in category)
        )
    query = BoardQuery(
        tasks=chosen,
        models=frozenset(model) if model else None,
        # An uploaded task is in the ranking over tasks only on request.
        overall=None if task else frozenset(builtin_tasks()),
    )
    question = Question(track=track or "", query=query, sweeps=sweeps, members=members)
    return Selection(track=track, tracks=[*ended], question=question)


def track_or_default(services: Services, asked: str | None, ended: Mapping[str, int]) -> str | None:
    """Return the requested track, or the default.

    Args:
        asked: The track's name, if there is one.
        ended: Number of ended jobs of each track.

    Raises:
        ProblemError: No job of such a track has ended.
    """
    if asked is None:
        return default_track(ended, services.submissions.standard_track())
    if asked not in ended:
        raise unknown("track", asked, list(ended))
    return asked


SelectionDep = Annotated[Selection, Depends(select_board)]


router = APIRouter(prefix="/v1", tags=["leaderboard"], dependencies=[limited("heavy")])


class Comparison(View):
    """Two models on all tasks that both played."""

    track: str | None
    first: str
    second: str
    sentence: str | None
    """Verdict over these tasks, by the tests of a board of the two; null without a common task."""
    better: Literal["first", "second"] | None
    """The model that is better over these tasks beyond chance."""
    tasks: list[TaskComparison]


class VerifyRequest(Document):
    """Selection of results to verify."""

    track: Annotated[str | None, Field(description=DEFAULT_TRACK)] = None
    model: str
    tasks: list[str] | None = None
    sample: Annotated[int | None, Field(ge=1, le=10_000)] = None
    """Default: all."""
    seed: int = 0
    """Seed of the random sample."""


class VerifyAccepted(View):
    """Verifications that were requested."""

    scored: int
    """Scored jobs of the model."""
    verification_ids: list[str]
    """See /v1/verifications/{verification_id}."""
    skipped_job_ids: list[str]
    """Jobs that were not queued, as the key has as many open verifications as it may: request them
    again when some have ended."""


def board_answer(services: Services, selection: Selection, kind: str, render: Render) -> Answer:
    """Return a board in some form, cached.

    Args:
        kind: The form.
        render: Makes it of a ranked board and its view.
    """

    def answer(ranked: RankedBoard) -> bytes:
        board = board_view(
            ranked,
            track=selection.question.track,
            tracks=selection.tracks,
            registry=services.registry,
            catalogue=services.context.tasks,
        )
        return render(ranked, board)

    return services.boards.answer(
        selection.question, f"{kind} {' '.join(selection.tracks)}", answer
    )


@router.get("/leaderboard", response_model=Board)
def leaderboard(services: ServicesDep, selection: SelectionDep, request: Request) -> Any:
    """Rank the models of one track, on each task and overall; tracks are never mixed."""
    if selection.track is None:
        return NO_BOARD
    answer = board_answer(
        services, selection, "json", lambda _, board: board.model_dump_json().encode()
    )
    return conditional(request, answer, "application/json")


@router.get("/leaderboard/compare")
def compare(
    services: ServicesDep,
    selection: SelectionDep,
    first: Annotated[str, Query(description="A model, or model@configuration")],
    second: Annotated[str, Query(description="Another")],
) -> Comparison:
    """Compare two models, task by task."""
    comparison = compare_models({}, {})
    if selection.track is not None:
        every = services.boards.inside(selection.question)
        cells = _usual(every, selection.track, "first", first)
        other = _usual(every, selection.track, "second", second)
        if cells == other:
            raise invalid("second", f"is the same configuration as the first, {first}")
        comparison = compare_models(cells, other)
    return Comparison(
        track=selection.track,
        first=first,
        second=second,
        sentence=comparison.sentence,
        better=comparison.better,
        tasks=list(comparison.tasks),
    )


def _usual(
    every: Mapping[CellId, CellRecord], track: str | None, field: str, name: str
) -> dict[str, Cell]:
    """Return the cells by task of a model's configuration with the most jobs."""
    model, _, prefix = name.partition("@")
    jobs: Counter[str] = Counter()
    for id_, cell in every.items():
        if cell.model == model and id_.configuration.startswith(prefix):
            jobs[id_.configuration] += cell.jobs
    if not jobs:
        choices = sorted({f"{cell.model}@{id_.configuration[:8]}" for id_, cell in every.items()})
        raise invalid(
            field,
            f"unknown model {name!r} on the track {track}",
            choices=choices,
            code=ErrorCode.UNKNOWN_NAME,
        )
    usual = max(sorted(jobs), key=jobs.__getitem__)
    return {id_.task: record.summary for id_, record in every.items() if id_.configuration == usual}


@router.post("/leaderboard/verify")
def verify(body: VerifyRequest, services: ServicesDep, caller: CallerDep) -> VerifyAccepted:
    """Replay and re-simulate all of a model's results on a board, or a sample.

    Imported results count when they were verified.
    """
    track = track_or_default(services, body.track, services.boards.tracks())
    query = BoardQuery(tasks=frozenset(body.tasks) if body.tasks else None)
    question = Question(track=track or "", query=query)
    every = services.boards.inside(question)
    own = [id_ for id_, cell in every.items() if cell.model == body.model]
    scored = services.boards.scored_ids(question, own)
    if not scored:
        raise unknown("model", body.model, sorted({cell.model for cell in every.values()}))
    chosen = scored
    if body.sample is not None and body.sample < len(scored):
        # The same seed gives the same sample; nothing secret depends on it.
        chosen = random.Random(body.seed).sample(scored, body.sample)  # noqa: S311
    asked = request_verifications(services.context, chosen, caller)
    return VerifyAccepted(
        scored=len(scored),
        verification_ids=list(asked.ids.values()),
        skipped_job_ids=list(asked.left),
    )
