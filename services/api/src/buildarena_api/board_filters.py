"""Which jobs a board is asked for, and the board's part of the routes' dependencies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Query

from buildarena_api.dependencies import Services, ServicesDep, Track
from buildarena_api.http.problems import unknown
from buildarena_api.leaderboard.cache import Question
from buildarena_backend.catalog.tracks import default_track
from buildarena_benchmark import builtin_tasks, paper_tasks
from buildarena_benchmark.leaderboard import BoardQuery

DEFAULT_TRACK = (
    "Default: the standard track (what a sweep gets that names only tasks and models) once jobs of "
    "it have ended, otherwise the one with the most ended jobs"
)
MAX_SWEEPS = 50
"""Sweeps that one board is made of at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """A track and what of it; the track is None when no job has ended.

    Attributes:
        track: The track.
        tracks: All that could have been asked for.
        query: Which tasks and models.
        question: The same with the track and the sweeps.
    """

    track: str | None
    tracks: list[str]
    query: BoardQuery
    question: Question


def select_board(
    services: ServicesDep,
    *,
    track: Annotated[Track | None, Query(description=DEFAULT_TRACK)] = None,
    task: Annotated[list[str] | None, Query(description="Only these tasks")] = None,
    category: Annotated[
        list[str] | None,
        Query(
            description="Only tasks of these categories, over whose built-in ones models are "
            "ranked then; by default the overall ranking is over the paper's nine tasks, or over "
            "what there is where none of these was played"
        ),
    ] = None,
    model: Annotated[list[str] | None, Query(description="Only these models")] = None,
    sweep: Annotated[
        list[str] | None,
        Query(max_length=MAX_SWEEPS, description="Only jobs of these sweeps, and their tracks"),
    ] = None,
) -> Selection:
    """What the parameters ask for.

    Raises:
        ProblemError: A track, task or category is unknown.
        NotFoundError: A sweep is unknown.
    """
    context, boards = services.context, services.boards
    sweeps = frozenset(sweep) if sweep else None
    members = sum(context.store.sweeps.size(id_) for id_ in sorted(sweeps or ()))
    ended = boards.tracks(sweeps)
    track = track_or_default(services, track, ended)
    tasks = boards.tasks()
    for name in task or ():
        if name not in tasks:
            raise unknown("task", name, sorted(tasks))
    categories = sorted({entry.category for entry in tasks.values()})
    for name in category or ():
        if name not in categories:
            raise unknown("category", name, categories)
    chosen = None
    if task or category:
        chosen = frozenset(
            name
            for name, entry in tasks.items()
            if (not task or name in task) and (not category or entry.category in category)
        )
    query = BoardQuery(
        tasks=chosen,
        # Invented names are not told from each other: their empty boards are one.
        models=boards.known_models(model) if model else None,
        overall=_ranked_over(task, category),
    )
    question = Question(
        track=track or "",
        query=query,
        sweeps=sweeps,
        members=members,
    )
    return Selection(track=track, tracks=[*ended], query=query, question=question)


def track_or_default(services: Services, asked: str | None, ended: Mapping[str, int]) -> str | None:
    """The track that is asked for, or the one that is meant where none is named.

    Args:
        services: What serves the request.
        asked: The track's name, if there is one.
        ended: How many jobs of each track have ended.

    Raises:
        ProblemError: No job of such a track has ended.
    """
    if asked is None:
        return default_track(ended, services.submissions.standard_track())
    if asked not in ended:
        raise unknown("track", asked, list(ended))
    return asked


def _ranked_over(task: list[str] | None, category: list[str] | None) -> frozenset[str] | None:
    """Tasks that the overall ranking is over; None for all that are shown.

    A task that not everybody has played takes no model out of the ranking over all tasks, unless
    it is asked for.
    """
    if task:
        return None
    if category:
        return frozenset(name for name, one in builtin_tasks().items() if one.category in category)
    return frozenset(paper_tasks())


SelectionDep = Annotated[Selection, Depends(select_board)]
