"""Routes of sweeps."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Header, Query, Response
from sqlalchemy.exc import IntegrityError

from buildarena_api import cursors
from buildarena_api.dependencies import ContextDep, SubmissionsDep
from buildarena_api.problems import ProblemError, problem_responses
from buildarena_api.schemas import (
    ProgressView,
    SweepAccepted,
    SweepEstimate,
    SweepPage,
    SweepView,
)
from buildarena_pipeline.context import Context
from buildarena_pipeline.queues import CONSTRUCT
from buildarena_pipeline.specs import SweepSpec
from buildarena_pipeline.submission import spec_hash
from buildarena_pipeline.sweeper import announce_waiting
from buildarena_store import Sweep

router = APIRouter(prefix="/v1/sweeps", tags=["sweeps"])


RequestKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        description="The same key with the same sweep returns the first submission's answer",
    ),
]


@router.post("", status_code=202, responses=problem_responses(409, 422, 503))
def submit_sweep(
    spec: SweepSpec,
    response: Response,
    context: ContextDep,
    submissions: SubmissionsDep,
    request_key: RequestKey = None,
) -> SweepAccepted:
    """Submits every task with every model and every seed; all of it is stored, or nothing."""
    if request_key is not None:
        before = context.sweeps.by_request_key(request_key)
        if before is not None:
            return _accepted_before(before, spec, response, context)
    try:
        done = submissions.submit_sweep(spec, request_key=request_key)
    except IntegrityError:
        # Another request with this key was quicker.
        before = None if request_key is None else context.sweeps.by_request_key(request_key)
        if before is None:
            raise
        return _accepted_before(before, spec, response, context)
    response.headers["Location"] = f"/v1/sweeps/{done.sweep.id}"
    return SweepAccepted(id=done.sweep.id, jobs=done.jobs, added=done.added)


def _accepted_before(
    sweep: Sweep, spec: SweepSpec, response: Response, context: Context
) -> SweepAccepted:
    if sweep.request_hash != spec_hash(spec):
        raise ProblemError(409, "this Idempotency-Key was used for another sweep")
    response.headers["Location"] = f"/v1/sweeps/{sweep.id}"
    total = context.sweeps.progress(sweep.id).total
    return SweepAccepted(id=sweep.id, jobs=total, added=0)


@router.post("/estimate", responses=problem_responses(422, 503))
def estimate_sweep(spec: SweepSpec, submissions: SubmissionsDep) -> SweepEstimate:
    """Tells what a sweep would consist of and about what it would cost; stores nothing."""
    return SweepEstimate.model_validate(submissions.estimate(spec))


@router.post("/{sweep_id}/pause", responses=problem_responses(404, 409, 503))
def pause_sweep(sweep_id: str, context: ContextDep) -> SweepView:
    """Holds the sweep's waiting jobs; jobs that have begun go on to their end."""
    return _change(context, sweep_id, "paused")


@router.post("/{sweep_id}/resume", responses=problem_responses(404, 409, 503))
def resume_sweep(sweep_id: str, context: ContextDep) -> SweepView:
    """Lets a paused sweep go on."""
    return _change(context, sweep_id, "active")


@router.post("/{sweep_id}/cancel", responses=problem_responses(404, 409, 503))
def cancel_sweep(sweep_id: str, context: ContextDep) -> SweepView:
    """Ends the sweep's jobs that have not ended and that no other active sweep wants."""
    return _change(context, sweep_id, "cancelled")


ALLOWED = {"paused": {"active"}, "active": {"paused"}, "cancelled": {"active", "paused"}}
"""From which states a sweep may come into one."""


def _change(context: Context, sweep_id: str, state: str) -> SweepView:
    sweep = context.sweeps.get(sweep_id)
    if sweep.state not in ALLOWED[state]:
        raise ProblemError(409, f"sweep {sweep_id} is {sweep.state}; it can't become {state}")
    with context.database.transaction() as connection:
        if state == "paused":
            context.sweeps.hold(sweep_id, connection=connection)
        elif state == "active":
            context.sweeps.release(sweep_id, connection=connection)
        else:
            own = context.sweeps.own_jobs(sweep_id, connection=connection)
            context.jobs.cancel(own, connection=connection)
        context.sweeps.set_state(sweep_id, state, connection=connection)
    announce_waiting(context, CONSTRUCT)
    return _view(context, context.sweeps.get(sweep_id))


@router.get("", responses=problem_responses(422, 503))
def list_sweeps(
    context: ContextDep,
    cursor: Annotated[str | None, Query(max_length=500)] = None,
    limit: Annotated[int, Query(ge=1, le=100)] = 20,
) -> SweepPage:
    """Lists sweeps, newest first."""
    found = context.sweeps.page(
        limit=limit, after=None if cursor is None else cursors.decode(cursor)
    )
    more = len(found) == limit
    return SweepPage(
        sweeps=[_view(context, sweep) for sweep in found],
        next_cursor=cursors.encode(found[-1].created_at, found[-1].id) if more else None,
    )


@router.get("/{sweep_id}", responses=problem_responses(404, 503))
def show_sweep(sweep_id: str, context: ContextDep) -> SweepView:
    """Shows a sweep and how far it is."""
    return _view(context, context.sweeps.get(sweep_id))


def _view(context: Context, sweep: Sweep) -> SweepView:
    progress = context.sweeps.progress(sweep.id)
    ended = sweep.state == "active" and progress.done == progress.total
    return SweepView(
        id=sweep.id,
        name=sweep.name,
        state="done" if ended else sweep.state,
        created_at=sweep.created_at,
        spec=dict(sweep.spec),
        progress=ProgressView.of(progress),
    )
