"""Routes of sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from typing import Annotated, Any, Final

from fastapi import APIRouter, Header, Query, Response
from pydantic import BaseModel, ConfigDict
from sqlalchemy.exc import IntegrityError

from buildarena_api.access import Caller, CallerDep
from buildarena_api.dependencies import ContextDep, IdPrefix, ServicesDep
from buildarena_api.http import cursors
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_api.schemas import (
    DONE,
    BudgetView,
    ForecastView,
    ProgressView,
    SweepAccepted,
    SweepEstimate,
    SweepPage,
    SweepView,
    TroubleView,
)
from buildarena_backend.catalog.specs import Budget, SweepSpec
from buildarena_backend.process.context import Context
from buildarena_backend.states import CONSTRUCT_QUEUE, SweepState
from buildarena_backend.submission.submission import spec_hash
from buildarena_backend.sweeps.sweeps import Sweep, SweepProgress

router = APIRouter(prefix="/v1/sweeps", tags=["sweeps"])
MAX_TROUBLES: Final = 50
"""Kinds of trouble that one answer has."""
DEFAULT_LIMIT: Final = 20


RequestKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        description="The same key with the same sweep returns the first submission's answer",
    ),
]


Resume = Annotated[
    bool,
    Query(
        description="Let the caller's earlier sweep of just these jobs, if there is one, go on "
        "with this one's budget, instead of storing a further sweep"
    ),
]


class Resumption(BaseModel):
    """How to resume a sweep."""

    model_config = ConfigDict(extra="forbid")

    budget: Budget | None = None


@router.post("", status_code=202, responses=problem_responses(409, 422, 503))
def submit_sweep(
    spec: SweepSpec,
    response: Response,
    *,
    context: ContextDep,
    services: ServicesDep,
    caller: CallerDep,
    request_key: RequestKey = None,
    resume: Resume = False,
) -> SweepAccepted:
    """Submits every task with every model and every seed; all of it is stored, or nothing."""
    if request_key is not None:
        # One key's idempotency keys are not another's.
        request_key = f"{caller.key_id or ''}/{request_key}"
        before = context.store.sweeps.by_request_key(request_key)
        if before is not None:
            return _accepted_before(before, spec, response, context)
    try:
        done = services.submissions.submit_sweep(
            spec, owner=caller.key_id, request_key=request_key, resume=resume
        )
    except IntegrityError:
        # Another request with this key was quicker.
        before = None if request_key is None else context.store.sweeps.by_request_key(request_key)
        if before is None:
            raise
        return _accepted_before(before, spec, response, context)
    response.headers["Location"] = f"/v1/sweeps/{done.sweep.id}"
    return SweepAccepted(id=done.sweep.id, jobs=done.jobs, added=done.added, resumed=done.resumed)


def _accepted_before(
    sweep: Sweep, spec: SweepSpec, response: Response, context: Context
) -> SweepAccepted:
    if sweep.request_hash != spec_hash(spec):
        raise ProblemError(409, "this Idempotency-Key was used for another sweep")
    response.headers["Location"] = f"/v1/sweeps/{sweep.id}"
    total = context.store.sweeps.progress(sweep.id).total
    return SweepAccepted(id=sweep.id, jobs=total, added=0)


@router.post("/estimate", responses=problem_responses(422, 503))
def estimate_sweep(spec: SweepSpec, services: ServicesDep) -> SweepEstimate:
    """Estimates a sweep's jobs and their cost; stores nothing."""
    return SweepEstimate.model_validate(services.submissions.estimate(spec))


@router.post("/{sweep_id}/pause", responses=problem_responses(404, 409, 503))
def pause_sweep(sweep_id: str, context: ContextDep, caller: CallerDep) -> SweepView:
    """Puts the sweep's waiting jobs on hold; running jobs continue.

    Jobs that another sweep or key wants now go on at its expense.
    """
    _require_owner(context, caller, sweep_id)
    context.store.lifecycle.pause(sweep_id)
    return _view(context, context.store.sweeps.get(sweep_id))


@router.post("/{sweep_id}/resume", responses=problem_responses(404, 409, 422, 503))
def resume_sweep(
    sweep_id: str,
    context: ContextDep,
    caller: CallerDep,
    services: ServicesDep,
    body: Resumption | None = None,
) -> SweepView:
    """Resumes a paused sweep, or one whose budget is used up, with a larger budget if given."""
    _require_owner(context, caller, sweep_id)
    services.submissions.resume(sweep_id, None if body is None else body.budget)
    return _view(context, context.store.sweeps.get(sweep_id))


@router.put("/{sweep_id}/budget", responses=problem_responses(404, 409, 422, 503))
def set_sweep_budget(
    sweep_id: str,
    body: Budget,
    context: ContextDep,
    caller: CallerDep,
    services: ServicesDep,
) -> SweepView:
    """Sets the sweep's budget, whatever was spent before included; it replaces the one before.

    A sweep whose budget was used up goes on, a paused one stays paused.
    """
    _require_owner(context, caller, sweep_id)
    services.submissions.set_budget(sweep_id, body)
    return _view(context, context.store.sweeps.get(sweep_id))


@router.post("/{sweep_id}/cancel", responses=problem_responses(404, 409, 503))
def cancel_sweep(sweep_id: str, context: ContextDep, caller: CallerDep) -> SweepView:
    """Ends the sweep's jobs that have not ended and that nobody else wants.

    The others go on at the expense of who wants them, or wait for them. This sweep never pays
    again.
    """
    _require_owner(context, caller, sweep_id)
    context.store.lifecycle.cancel(sweep_id)
    return _view(context, context.store.sweeps.get(sweep_id))


@router.post("/{sweep_id}/retry", status_code=202, responses=problem_responses(404, 409, 503))
def retry_sweep(sweep_id: str, context: ContextDep, caller: CallerDep) -> SweepView:
    """Queues the sweep's errored jobs again where they failed; scored ones are never redone.

    The sweep pays for them. A job of another key that still wants it is left to that key.
    """
    _require_owner(context, caller, sweep_id)
    context.store.lifecycle.retry(sweep_id)
    context.queues.wake(CONSTRUCT_QUEUE)
    return _view(context, context.store.sweeps.get(sweep_id))


def _require_owner(context: Context, caller: Caller, sweep_id: str) -> None:
    caller.require_owner(context.store.sweeps.get(sweep_id).owner, f"sweep {sweep_id}")


@router.get("", responses=problem_responses(422, 503))
def list_sweeps(
    context: ContextDep,
    cursor: Annotated[str | None, Query(max_length=500)] = None,
    limit: Annotated[int, Query(ge=1, le=100)] = DEFAULT_LIMIT,
    id_prefix: IdPrefix = None,
) -> SweepPage:
    """Lists sweeps, newest first."""
    found = context.store.sweeps.page(
        limit=limit,
        after=None if cursor is None else cursors.decode(cursor),
        id_prefix=id_prefix,
    )
    more = len(found) == limit
    return SweepPage(
        sweeps=_views(context, found),
        next_cursor=cursors.encode(found[-1].created_at, found[-1].id) if more else None,
    )


@router.get("/{sweep_id}", responses=problem_responses(404, 503))
def show_sweep(sweep_id: str, context: ContextDep) -> SweepView:
    """Shows a sweep and its progress."""
    return _view(context, context.store.sweeps.get(sweep_id))


@router.get("/{sweep_id}/forecast", responses=problem_responses(404, 503))
def forecast_sweep(sweep_id: str, context: ContextDep) -> ForecastView:
    """Forecasts when a sweep ends and what it comes to cost, from what ran so far."""
    store = context.store
    ahead, budget = store.sweeps.forecast(sweep_id), store.budgets.get(sweep_id)
    most = None if budget is None else budget.limits.max_cost_usd
    short = None
    if budget is not None and most is not None:
        short = float(max(Decimal(), budget.spent_cost_usd + ahead.own_cost_usd_left - most))
    return ForecastView(
        jobs_left=ahead.jobs_left,
        jobs_per_minute=ahead.jobs_per_minute,
        ends_at=ahead.ends_at,
        cost_usd_left=float(ahead.cost_usd_left),
        cost_usd_total=float(store.sweeps.progress(sweep_id).cost_usd + ahead.cost_usd_left),
        budget_usd_short=short,
        unknown_models=list(ahead.unknown_models),
    )


@router.get("/{sweep_id}/troubles", responses=problem_responses(404, 503))
def sweep_troubles(sweep_id: str, context: ContextDep) -> list[TroubleView]:
    """Attempts at the sweep's jobs that faults ended, at providers say; the newest kinds first.

    Transient ones are made again; jobs that ended by them have the outcome `errored`.
    """
    context.store.sweeps.get(sweep_id)
    found = context.store.sweeps.troubles(sweep_id, limit=MAX_TROUBLES)
    return [TroubleView.model_validate(trouble) for trouble in found]


def _view(context: Context, sweep: Sweep) -> SweepView:
    return _views(context, [sweep])[0]


def _views(context: Context, found: Sequence[Sweep]) -> list[SweepView]:
    # Read before the progress, which then holds all that it says.
    last_event = context.store.events.settled()
    progress = context.store.sweeps.progress_of([sweep.id for sweep in found])
    return [
        SweepView(
            id=sweep.id,
            name=sweep.name,
            state=_state(sweep, progress[sweep.id]),
            owner=sweep.owner,
            created_at=sweep.created_at,
            spec=dict(sweep.spec),
            budget=BudgetView.of(context.store.budgets.get(sweep.id)),
            progress=ProgressView.of(progress[sweep.id]),
            last_event=last_event,
        )
        for sweep in found
    ]


def _state(sweep: Sweep, progress: SweepProgress) -> Any:
    ended = sweep.state == SweepState.ACTIVE and progress.done == progress.total
    return DONE if ended else sweep.state
