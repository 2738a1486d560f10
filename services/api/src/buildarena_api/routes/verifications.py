"""Routes of verifications: finished jobs checked by replay and re-simulation."""

from __future__ import annotations

from collections.abc import Sequence

from fastapi import APIRouter, Response

from buildarena_api.access import Caller, CallerDep, limited
from buildarena_api.dependencies import ContextDep, RequestKey
from buildarena_api.http.problems import ErrorCode, ProblemError
from buildarena_api.schemas import EXISTED, tell_created
from buildarena_backend.process.context import Context
from buildarena_backend.results.verifications import MAX_OPEN, Admission, Verification
from buildarena_backend.states import VERIFY_QUEUE

router = APIRouter(prefix="/v1", tags=["verification"], dependencies=[limited()])

RETRY_S = 5
"""Retry-After of a caller whose verifications were not added."""


@router.post("/jobs/{job_id}/verify", status_code=201, responses=EXISTED)
def verify_job(
    job_id: str, context: ContextDep, response: Response, caller: CallerDep, _: RequestKey
) -> Verification:
    """Replay a scored job without a model, re-simulate it, and compare every figure.

    While an equal verification is open, that one is the answer.
    """
    job = context.store.jobs.get(job_id)
    if job.success is None:
        raise ProblemError(ErrorCode.ILLEGAL_STATE, f"job {job_id} has no score to verify")
    requested = request_verifications(context, [job_id], caller)
    (verification_id,) = requested.ids.values()
    tell_created(response, f"/v1/verifications/{verification_id}", is_new=requested.added > 0)
    return context.store.verifications.get(verification_id)


def request_verifications(context: Context, job_ids: Sequence[str], caller: Caller) -> Admission:
    """Request verifications of jobs and notify a worker.

    Raises:
        ProblemError: 429, when no verification can be added.
    """
    requested = context.store.verifications.request(job_ids, owner=caller.key_id)
    if not requested.ids:
        raise ProblemError(
            ErrorCode.TOO_MANY_OPEN,
            f"{MAX_OPEN} verifications are open, as many as one key may have: wait for some to end",
            headers={"Retry-After": str(RETRY_S)},
        )
    # Any message makes a worker do all that wait.
    context.queues.wake(VERIFY_QUEUE)
    return requested


@router.get("/verifications/{verification_id}")
def show_verification(verification_id: str, context: ContextDep) -> Verification:
    """Return a verification and, once it is done, its report."""
    return context.store.verifications.get(verification_id)
