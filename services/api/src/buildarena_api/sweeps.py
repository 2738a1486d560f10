"""Routes of sweeps."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response

from buildarena_api import cursors
from buildarena_api.dependencies import ContextDep, SubmissionsDep
from buildarena_api.problems import problem_responses
from buildarena_api.schemas import ProgressView, SweepAccepted, SweepPage, SweepView
from buildarena_pipeline.context import Context
from buildarena_pipeline.specs import SweepSpec
from buildarena_store import Sweep

router = APIRouter(prefix="/v1/sweeps", tags=["sweeps"])


@router.post("", status_code=202, responses=problem_responses(422, 503))
def submit_sweep(spec: SweepSpec, response: Response, submissions: SubmissionsDep) -> SweepAccepted:
    """Submits every task with every model and every seed; all of it is stored, or nothing."""
    done = submissions.submit_sweep(spec)
    response.headers["Location"] = f"/v1/sweeps/{done.sweep.id}"
    return SweepAccepted(id=done.sweep.id, jobs=done.jobs, added=done.added)


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
