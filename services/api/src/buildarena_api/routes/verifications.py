"""Routes of verifications: finished jobs checked by replay and re-simulation."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, Field

from buildarena_api.dependencies import ContextDep
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_store.states import VERIFY_QUEUE, VerificationState

router = APIRouter(prefix="/v1", tags=["verification"])


class VerificationView(BaseModel):
    """A check of one job."""

    model_config = ConfigDict(from_attributes=True)

    id: str
    job_id: str
    state: Literal[VerificationState.QUEUED, VerificationState.RUNNING, VerificationState.DONE]
    report: dict[str, Any] | None = Field(
        description="ok, and checks with name, ok, kept and found; null until it is done"
    )
    created_at: datetime
    finished_at: datetime | None


@router.post("/jobs/{job_id}/verify", status_code=202, responses=problem_responses(404, 409, 503))
def verify_job(job_id: str, context: ContextDep, response: Response) -> VerificationView:
    """Replays a scored job without a model, re-simulates it, and compares every figure."""
    job = context.store.jobs.get(job_id)
    if job.success is None:
        raise ProblemError(409, f"job {job_id} has no score to verify")
    verification_id = context.store.verifications.request(job_id)
    context.queues.notify(VERIFY_QUEUE, [verification_id])
    response.headers["Location"] = f"/v1/verifications/{verification_id}"
    return VerificationView.model_validate(context.store.verifications.get(verification_id))


@router.get("/verifications/{verification_id}", responses=problem_responses(404, 503))
def show_verification(verification_id: str, context: ContextDep) -> VerificationView:
    """Shows a verification and, once it is done, what it found."""
    return VerificationView.model_validate(context.store.verifications.get(verification_id))
