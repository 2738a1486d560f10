"""Routes of API keys: for admins."""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime, timedelta
from typing import Annotated, Any, Literal, Self

from fastapi import APIRouter, Response
from pydantic import Field, StrictInt, model_validator

from buildarena_api.access import admin_of, limited
from buildarena_api.dependencies import ContextDep, RequestKey, ServicesDep
from buildarena_api.http.pages import Page, PagingDep
from buildarena_api.schemas import EXISTED, BudgetUse, Document, View, tell_created
from buildarena_backend.accounts.keys import ApiKey
from buildarena_backend.catalog.specs import Budget, Title
from buildarena_backend.errors import SubmissionError
from buildarena_backend.process.context import Context
from buildarena_backend.settings import SimulatorName
from buildarena_backend.states import CONSTRUCT_QUEUE
from buildarena_backend.trials.known_simulators import simulator_issues

router = APIRouter(prefix="/v1/keys", tags=["keys"], dependencies=[limited(caller=admin_of)])


class NewKey(Document):
    """A request for a key."""

    name: Annotated[Title, Field(examples=["ada"])]
    """Name of its holder."""
    scopes: Annotated[
        list[Literal["read", "submit", "admin", "runner"]], Field(min_length=1, max_length=3)
    ]
    """read, submit and admin: each includes those before it; or runner alone, which may lease
    trials and nothing else."""
    simulators: Annotated[list[SimulatorName] | None, Field(min_length=1, max_length=10)] = None
    """Runner keys: simulators whose jobs its runners may lease."""
    job_owners: Annotated[
        list[Annotated[str, Field(pattern=r"^key_[0-9a-f]{1,40}$")]] | None,
        Field(min_length=1, max_length=100),
    ] = None
    """Runner keys: ids of the keys whose jobs may be leased; null for all."""
    expires_in_days: Annotated[StrictInt | None, Field(ge=1, le=3650)] = None
    """Days until it expires; null for never."""
    budget: Budget | None = None

    @model_validator(mode="after")
    def _is_of_one_kind(self) -> Self:
        if "runner" not in self.scopes:
            if self.simulators is not None or self.job_owners is not None:
                raise ValueError("simulators and job_owners are for keys with the scope runner")
        elif set(self.scopes) != {"runner"}:
            raise ValueError("the scope runner must be alone: a runner's key may do nothing else")
        elif self.simulators is None:
            raise ValueError("a runner key names its simulators; GET /v1/simulators lists them")
        elif self.budget is not None:
            raise ValueError("a runner key submits nothing, so it has no budget")
        return self


class Rotation(Document):
    """A request for another secret of a key."""

    overlap_hours: Annotated[float, Field(ge=0, le=24 * 90, allow_inf_nan=False)] = 24.0
    """Hours for which the present secret stays valid; 0 ends it at once."""


class KeyView(View):
    """A key without its secret."""

    id: str = Field(examples=["key_0a1b2c3d4e5f60718293"])
    name: str
    scopes: list[str]
    simulators: list[str] | None
    """Runner keys: simulators whose jobs it may lease."""
    job_owners: list[str] | None
    """Runner keys: keys whose jobs it may lease; null for all."""
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None
    used_at: datetime | None
    """Time of its last use, to the minute."""
    suspended_at: datetime | None
    """Runner keys: since then its runners may do nothing."""
    suspended_for: str | None
    """The verification that refuted a trial of its runners."""
    previous_expires_at: datetime | None = Field(validation_alias="previous_until")
    """End of the previous secret's validity; null without one."""
    budget: BudgetUse | None = None


class KeyCreated(KeyView):
    """A key that was just made."""

    secret: str | None
    """The secret for requests; it can't be read again. null if the key already existed, under the
    same Idempotency-Key."""


@router.post("", status_code=201, responses=EXISTED)
def create_key(
    body: NewKey, response: Response, context: ContextDep, request_key: RequestKey
) -> KeyCreated:
    """Make a key. Its secret is in this answer only."""
    issues = simulator_issues(context, *(body.simulators or ()), path="simulators")
    if issues:
        raise SubmissionError(issues)
    ttl = None if body.expires_in_days is None else timedelta(days=body.expires_in_days)
    key, secret = context.store.keys.create(
        name=body.name,
        scopes=body.scopes,
        ttl=ttl,
        simulators=body.simulators,
        job_owners=body.job_owners,
        key_id=None if request_key is None else f"key_{request_key[:20]}",
    )
    if body.budget is not None and secret is not None:
        with context.store.database.transaction() as connection:
            context.store.budgets.set(key.id, body.budget.as_limits(), connection=connection)
    tell_created(response, f"/v1/keys/{key.id}", is_new=secret is not None)
    response.headers["Cache-Control"] = "no-store"
    return _created(context, key, secret)


@router.get("")
def list_keys(context: ContextDep, paging: PagingDep) -> Page[KeyView]:
    """List all keys, oldest first, including revoked and expired ones."""
    page = paging.of(context.store.keys.all())
    return Page[KeyView](**page | {"data": [_view(context, key) for key in page["data"]]})


@router.post("/{key_id}/rotate")
def rotate_key(
    key_id: str, body: Rotation, response: Response, services: ServicesDep
) -> KeyCreated:
    """Give a key another secret, which is in this answer only; it keeps what it owns.

    Its present secret stays valid for a while. The one before it ends at once.
    """
    overlap = timedelta(hours=body.overlap_hours)
    key, secret = services.context.store.keys.rotate(key_id, overlap=overlap)
    services.key_checks.forget()
    response.headers["Cache-Control"] = "no-store"
    return _created(services.context, key, secret)


@router.post("/{key_id}/revoke")
def revoke_key(key_id: str, services: ServicesDep) -> KeyView:
    """Revoke a key at once; its jobs continue."""
    revoked = _view(services.context, services.context.store.keys.revoke(key_id))
    services.key_checks.forget()
    return revoked


@router.post("/{key_id}/reinstate")
def reinstate_key(key_id: str, services: ServicesDep) -> KeyView:
    """Let a key work again that was suspended because a trial of its runners was refuted."""
    reinstated = _view(services.context, services.context.store.keys.reinstate(key_id))
    services.key_checks.forget()
    return reinstated


@router.put("/{key_id}/budget")
def set_budget(key_id: str, body: Budget, context: ContextDep) -> KeyView:
    """Set the budget of all jobs of a key, and resume its single jobs that had to stop.

    Sweeps that stopped without budget continue when they are resumed.
    """
    key = context.store.keys.get(key_id)
    with context.store.lifecycle.command() as connection:
        context.store.budgets.set(key_id, body.as_limits(), connection=connection)
        context.store.lifecycle.release_single_jobs(key_id, connection=connection)
    context.queues.wake(CONSTRUCT_QUEUE)
    return _view(context, key)


def _view(context: Context, key: ApiKey) -> KeyView:
    return KeyView.model_validate(_fields(context, key))


def _created(context: Context, key: ApiKey, secret: str | None) -> KeyCreated:
    return KeyCreated.model_validate({**_fields(context, key), "secret": secret})


def _fields(context: Context, key: ApiKey) -> dict[str, Any]:
    return {**asdict(key), "budget": context.store.budgets.get(key.id)}
