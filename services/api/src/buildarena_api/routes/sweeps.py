"""Routes of sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated, Final

from fastapi import APIRouter, Depends, Query, Response

from buildarena_api.access import CallerDep, limited
from buildarena_api.dependencies import ContextDep, IdPrefix, RequestKey, ServicesDep
from buildarena_api.http.pages import NEWEST_FIRST, Page, PagingDep, encode
from buildarena_api.schemas import (
    EXISTED,
    Document,
    SweepAccepted,
    SweepEstimate,
    SweepFaultView,
    SweepView,
    tell_created,
)
from buildarena_backend.catalog.specs import Budget, SweepSpec
from buildarena_backend.process.context import Context
from buildarena_backend.states import CONSTRUCT_QUEUE, SweepState
from buildarena_backend.sweeps.forecasts import Forecast
from buildarena_backend.sweeps.sweeps import Sweep, SweepProgress

router = APIRouter(prefix="/v1/sweeps", tags=["sweeps"], dependencies=[limited()])
MAX_SWEEP_FAULTS: Final = 50
"""Kinds of fault that one answer has."""
Resume = Annotated[
    bool,
    Query(
        description="Let the caller's earlier sweep of just these jobs, if there is one, go on "
        "with this one's budget, instead of storing a further sweep"
    ),
]


def _own(sweep_id: str, context: ContextDep, caller: CallerDep) -> str:
    caller.require_owner(context.store.sweeps.get(sweep_id).owner, f"sweep {sweep_id}")
    return sweep_id


OwnSweep = Annotated[str, Depends(_own)]
"""The id of a sweep in the path, which the caller may change."""


class Resumption(Document):
    """Options of resuming a sweep."""

    budget: Budget | None = None


@router.post("", status_code=201, responses=EXISTED)
def submit_sweep(
    spec: SweepSpec,
    response: Response,
    *,
    services: ServicesDep,
    caller: CallerDep,
    request_key: RequestKey,
    resume: Resume = False,
) -> SweepAccepted:
    """Submit every task with every model and every seed; all of it is stored, or nothing."""
    done = services.submissions.submit_sweep(
        spec, owner=caller.key_id, request_key=request_key, resume=resume
    )
    tell_created(response, f"/v1/sweeps/{done.sweep.id}", is_new=done.fresh)
    return SweepAccepted(id=done.sweep.id, jobs=done.jobs, added=done.added, resumed=done.resumed)


@router.post("/estimate")
def estimate_sweep(spec: SweepSpec, services: ServicesDep) -> SweepEstimate:
    """Estimate a sweep's jobs and their cost; store nothing."""
    return SweepEstimate.model_validate(services.submissions.estimate(spec))


@router.post("/{sweep_id}/pause")
def pause_sweep(sweep_id: OwnSweep, context: ContextDep) -> SweepView:
    """Put the sweep's waiting jobs on hold; running jobs continue.

    Jobs with another claim continue at the claimant's expense.
    """
    context.store.lifecycle.pause(sweep_id)
    return _view(context, sweep_id)


@router.post("/{sweep_id}/resume")
def resume_sweep(
    sweep_id: OwnSweep, services: ServicesDep, body: Resumption | None = None
) -> SweepView:
    """Resume a paused sweep, or one whose budget is used up, with a larger budget if given."""
    services.submissions.resume(sweep_id, None if body is None else body.budget)
    return _view(services.context, sweep_id)


@router.put("/{sweep_id}/budget")
def set_sweep_budget(sweep_id: OwnSweep, body: Budget, services: ServicesDep) -> SweepView:
    """Set the sweep's budget, which includes earlier spending and replaces the one before.

    A sweep whose budget was used up continues, a paused one stays paused.
    """
    services.submissions.set_budget(sweep_id, body)
    return _view(services.context, sweep_id)


@router.post("/{sweep_id}/cancel")
def cancel_sweep(sweep_id: OwnSweep, context: ContextDep) -> SweepView:
    """End the sweep's jobs that have not ended and have no other claim.

    The others continue at the expense of their claimants, or wait for them. This sweep never pays
    again.
    """
    context.store.lifecycle.cancel(sweep_id)
    return _view(context, sweep_id)


@router.post("/{sweep_id}/retry")
def retry_sweep(sweep_id: OwnSweep, context: ContextDep) -> SweepView:
    """Queue the sweep's errored jobs again where they failed; scored ones are never redone.

    The sweep pays for them. A job of another key that still wants it is left to that key.
    """
    context.store.lifecycle.retry(sweep_id)
    context.queues.wake(CONSTRUCT_QUEUE)
    return _view(context, sweep_id)


@router.get("")
def list_sweeps(
    context: ContextDep,
    paging: PagingDep,
    *,
    name: Annotated[list[str] | None, Query(description="Only sweeps with these names")] = None,
    state: Annotated[list[SweepState] | None, Query(description="Only in these states")] = None,
    key_id: Annotated[list[str] | None, Query(description="Only of these API keys")] = None,
    id_prefix: IdPrefix = None,
) -> Page[SweepView]:
    """List sweeps, newest first."""
    sweeps = context.store.sweeps.page(
        limit=paging.limit + 1,
        after=paging.after(),
        id_prefix=id_prefix,
        names=name,
        states=state,
        owners=key_id,
    )
    shown, following = paging.cut(sweeps, lambda row: encode(NEWEST_FIRST, row.created_at, row.id))
    return Page[SweepView](data=_views(context, shown), next_cursor=following)


@router.get("/{sweep_id}")
def show_sweep(sweep_id: str, context: ContextDep) -> SweepView:
    """Show a sweep and its progress."""
    return _view(context, sweep_id)


@router.get("/{sweep_id}/forecast")
def forecast_sweep(sweep_id: str, context: ContextDep) -> Forecast:
    """Forecast the end and the cost of a sweep, from its jobs so far."""
    return context.store.sweeps.forecast(sweep_id, context.store.budgets.get(sweep_id))


@router.get("/{sweep_id}/faults")
def list_sweep_faults(
    sweep_id: str, context: ContextDep, paging: PagingDep
) -> Page[SweepFaultView]:
    """List failed attempts and slow or repeated requests of the sweep's jobs, newest first.

    Transient ones are made again; jobs that ended by them have the outcome `errored`.
    """
    context.store.sweeps.get(sweep_id)
    faults = context.store.sweeps.faults(sweep_id, limit=MAX_SWEEP_FAULTS)
    return Page[SweepFaultView].model_validate(paging.of(faults))


def _view(context: Context, sweep_id: str) -> SweepView:
    return _views(context, [context.store.sweeps.get(sweep_id)])[0]


def _views(context: Context, sweeps: Sequence[Sweep]) -> list[SweepView]:
    # Read before the progress, which then holds all that it says.
    last_event = context.store.events.settled()
    progress = context.store.sweeps.progress_of([sweep.id for sweep in sweeps])
    return [
        SweepView.model_validate(
            {
                **asdict(sweep),
                "state": _state(sweep, progress[sweep.id]),
                "key_id": sweep.owner,
                "budget": context.store.budgets.get(sweep.id),
                "progress": progress[sweep.id],
                "last_event": last_event,
            }
        )
        for sweep in sweeps
    ]


def _state(sweep: Sweep, progress: SweepProgress) -> SweepState:
    ended = sweep.state == SweepState.ACTIVE and progress.done == progress.total
    return SweepState.DONE if ended else SweepState(sweep.state)
