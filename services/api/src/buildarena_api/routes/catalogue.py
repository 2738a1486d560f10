"""Routes of models, modules, workers and other entries except tasks, and of the caller."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response
from pydantic import BeforeValidator, Field

from buildarena_api.access import SCOPES, CallerDep, limited
from buildarena_api.dependencies import ContextDep, ServicesDep
from buildarena_api.http.pages import NEWEST_FIRST, Page, PagingDep, encode
from buildarena_api.http.problems import ErrorCode, invalid
from buildarena_api.schemas import View
from buildarena_backend import __version__
from buildarena_backend.catalog.models import Price
from buildarena_backend.catalog.prices import listed_price
from buildarena_backend.states import simulate_queue
from buildarena_backend.trials.known_simulators import known_simulators
from buildarena_backend.trials.simulator import SimulatorKind
from buildarena_benchmark.scoring.flags import Flag
from buildarena_benchmark.scoring.registry import known_scorers
from buildarena_benchmark.statistics import ERROR, MIN_SUCCESSES
from buildarena_benchmark.tasks.task import SCORER_VERSION
from buildarena_geometry import FEEDBACK_VERSION, module_set
from buildarena_geometry.modules.module import Face
from buildarena_simulation import DEFAULT_ENGINE

router = APIRouter(prefix="/v1", dependencies=[limited()])
CONTRADICTORY = ErrorCode.CONTRADICTORY_PARAMETERS


def _labels(faces: Iterable[Face]) -> list[str]:
    return [face.label for face in faces]


class ModelView(View):
    """A model that jobs can name."""

    name: str = Field(examples=["openai/gpt-5"])
    provider: str
    model: str
    """The provider's own name of the snapshot."""
    baseline: bool
    price: Price | None = Field(description="US dollars per million tokens; null if unknown")


class ModuleView(View):
    """A module for building machines."""

    name: str
    kind: str
    mass: float
    cost: float
    description: str
    size: tuple[float, float, float] | None
    """Extents along its own x, y and z, units; null for connectors."""
    faces: Annotated[list[str], BeforeValidator(_labels)]
    """Labels of the faces that take a block."""
    actions: list[str]
    """Actions to which keys can be bound."""
    categories: list[str]
    """Groups it is looked up in; none for basic modules."""
    simulated: bool
    """Whether both engines have its physics."""


class ScorerView(View):
    """A scorer that task files can name."""

    name: str = Field(examples=["support"])
    description: str
    """Name of its indicator."""
    parameters: Annotated[dict[str, Any], BeforeValidator(lambda m: m.model_json_schema())]
    """JSON schema of `scoring` in a task file."""
    flags: list[Flag]


@router.get("/models", tags=["catalogue"])
def list_models(services: ServicesDep, paging: PagingDep) -> Page[ModelView]:
    """List the models of the registry."""
    models = [
        ModelView(
            **entry.model_dump(include={"name", "provider", "model", "baseline"}),
            price=listed_price(entry),
        )
        for entry in services.registry.models.values()
    ]
    return Page[ModelView].model_validate(paging.of(models))


@router.get("/modules", tags=["catalogue"])
def list_modules(
    context: ContextDep,
    paging: PagingDep,
    set_: Annotated[
        Literal["basic", "workshop", "all"] | None,
        Query(alias="set", description="The modules of a set; the basic ones by default"),
    ] = None,
    task: Annotated[str | None, Query(description="What builders of this task may use")] = None,
    version: Annotated[str | None, Query(description="Of the task; the newest by default")] = None,
) -> Page[ModuleView]:
    """List modules: the basic ones, those of a set, or those that a task allows."""
    if task is not None and set_ is not None:
        raise invalid("set", "pass either `set` or `task`, not both", code=CONTRADICTORY)
    if task is None and version is not None:
        raise invalid("version", "requires `task`", code=CONTRADICTORY)
    catalogue = (
        module_set(set_ or "basic")
        if task is None
        else context.tasks.find(task, version).task.constraints.catalogue
    )
    return Page[ModuleView].model_validate(paging.of(list(catalogue.values())))


@router.get("/scorers", tags=["catalogue"])
def list_scorers(paging: PagingDep) -> Page[ScorerView]:
    """List the scorers that task files can name, with their parameters and flags."""
    return Page[ScorerView].model_validate(paging.of(list(known_scorers().values())))


class SimulatorView(View):
    """A simulator that jobs can name."""

    name: str = Field(examples=["pybullet"])
    version: str = Field(examples=["3"])
    """The version in tracks' names: trials of two versions are never compared."""
    kind: SimulatorKind
    """engine: physics simulation; game: Besiege in its window."""
    deterministic: bool
    """Whether equal machines always have equal trials."""
    default: bool
    """Whether it is the default."""
    workers: int
    """Workers that reported within the last 15 seconds."""
    available: bool
    """Whether a worker for it is online, so that jobs don't wait."""


@router.get("/simulators", tags=["simulators"])
def list_simulators(context: ContextDep, paging: PagingDep) -> Page[SimulatorView]:
    """List the valid values of a job's `simulator`, and whether each is available now."""
    serving = Counter(context.store.workers.counts().serving)
    views = [
        SimulatorView(
            **asdict(simulator),
            default=simulator.name == DEFAULT_ENGINE,
            workers=serving[simulate_queue(simulator.name)],
            available=serving[simulate_queue(simulator.name)] > 0,
        )
        for simulator in known_simulators(context).values()
    ]
    return Page[SimulatorView](**paging.of(views))


class SimulatorVersion(View):
    """A simulator and its version, as tracks have them in their names."""

    name: str
    version: str


class VersionsView(View):
    """Versions that a result depends on; results of different versions never mix."""

    buildarena: str
    """Version of the service."""
    feedback: str
    """Version of the feedback to builders."""
    scorers: int
    """Version of the scoring; part of each task's version."""
    simulators: list[SimulatorVersion]
    family_wise_error_rate: float
    """Chance that a board makes any false claim, at most."""
    min_successes: int
    """Successes below which a mean indicator has no interval, as none would be valid."""


@router.get("/versions", tags=["catalogue"])
def show_versions(context: ContextDep) -> VersionsView:
    """Show the versions in use, and the constants of the boards' statistics."""
    return VersionsView.model_validate(
        {
            "buildarena": __version__,
            "feedback": FEEDBACK_VERSION,
            "scorers": SCORER_VERSION,
            "simulators": list(known_simulators(context).values()),
            "family_wise_error_rate": ERROR,
            "min_successes": MIN_SUCCESSES,
        }
    )


class WorkerView(View):
    """A process that works on jobs."""

    id: str = Field(
        examples=["simulate@lab3:4711-9f2c41", "runner@key_0a1b2c3d4e5f60718293/lab4-4711"]
    )
    """KIND@HOST:PID next to the database, runner@KEY/NAME where it reaches only the API."""
    kind: str = Field(examples=["simulate"])
    queues: list[str] = Field(examples=[["simulate.mujoco"]])
    host: str
    pid: int
    versions: dict[str, Any]
    started_at: datetime
    last_heartbeat_at: datetime
    alive: bool
    """Whether it reported within the last 15 seconds."""
    peak_memory_bytes: int | None
    clock_skew_s: float | None
    """Seconds by which its clock is ahead of the database's."""


@router.get("/workers", tags=["workers"])
def list_workers(context: ContextDep, paging: PagingDep) -> Page[WorkerView]:
    """List the workers that reported within the last hour, the last started first."""
    workers = context.store.workers.page(limit=paging.limit + 1, after=paging.after())
    shown, following = paging.cut(workers, lambda row: encode(NEWEST_FIRST, row.started_at, row.id))
    return Page[WorkerView].model_validate({"data": shown, "next_cursor": following})


class CallerView(View):
    """The caller and its permissions."""

    key_id: str | None
    """Id of the API key; null for the operator, and where no keys are required."""
    scopes: list[Literal["read", "submit", "admin"]]
    """Scopes of the key: each includes those before it."""
    keys_required: bool
    """Whether requests need an API key."""


@router.get("/caller", tags=["keys"])
async def show_caller(caller: CallerDep, context: ContextDep, response: Response) -> CallerView:
    """Return the authenticated caller and its scopes."""
    # Another key has another answer, at the same address.
    response.headers["Cache-Control"] = "no-store"
    return CallerView.model_validate(
        {
            "key_id": caller.key_id,
            "scopes": SCOPES[: SCOPES.index(caller.scope) + 1],
            "keys_required": context.settings.require_keys,
        }
    )
