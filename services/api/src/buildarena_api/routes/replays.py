"""Routes of replays: how a job's machine came about."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request

from buildarena_api.dependencies import ServicesDep
from buildarena_api.http.etags import conditional
from buildarena_api.replays.views import ReplayView

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


@router.get("/{job_id}/replay", response_model=ReplayView)
def show_replay(job_id: str, services: ServicesDep, request: Request) -> Any:
    """How the job's machine came about: every action with what it changed, or why it was refused.

    It is the geometry library's own account: the kept actions are done again. Of a session in
    several rounds it tells the last. While a session is under way it goes as far as that has come.
    """
    answer = services.replays.answer(services.context.store.jobs.get(job_id))
    return conditional(request, answer, "application/json")
