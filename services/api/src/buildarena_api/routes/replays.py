"""Routes of replays: how a job's machine came about."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request

from buildarena_api.dependencies import ContextDep
from buildarena_api.http.etags import conditional
from buildarena_api.http.problems import problem_responses
from buildarena_api.http.weights import weighs
from buildarena_api.replays.making import Replays
from buildarena_api.replays.views import ReplayView

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


async def _replays(request: Request) -> Replays:
    replays: Replays = request.app.state.replays
    return replays


@router.get("/{job_id}/replay", response_model=ReplayView, responses=problem_responses(404, 503))
@weighs(5)
def show_replay(
    job_id: str,
    context: ContextDep,
    replays: Annotated[Replays, Depends(_replays)],
    request: Request,
) -> Any:
    """How the job's machine came about: every action with what it changed, or why it was refused.

    It is the geometry library's own account: the kept actions are done again. Of a session in
    several rounds it tells the last. While a session is under way it goes as far as that has come.
    """
    answer = replays.answer(context.store.jobs.get(job_id))
    return conditional(request, answer, "application/json")
