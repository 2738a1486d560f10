"""Routes of simulators: what runs machines here."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict

from fastapi import APIRouter
from pydantic import BaseModel, Field

from buildarena_api.dependencies import ContextDep
from buildarena_api.http.pages import Page, PagingDep
from buildarena_backend.states import simulate_queue
from buildarena_backend.trials.known_simulators import known_simulators
from buildarena_backend.trials.simulator import SimulatorKind
from buildarena_simulation import DEFAULT_ENGINE

router = APIRouter(prefix="/v1/simulators", tags=["simulators"])


class SimulatorView(BaseModel):
    """A simulator that jobs can name."""

    name: str = Field(examples=["pybullet"])
    version: str = Field(
        description="As tracks have it in their names: trials of two versions are never compared",
        examples=["3"],
    )
    kind: SimulatorKind = Field(
        description="engine: physics simulation; game: Besiege in its window"
    )
    repeatable: bool = Field(description="Whether the same machine has the same trial again")
    default: bool = Field(description="Whether jobs that name none are run by it")
    workers: int = Field(description="Workers that reported within the last 15 seconds")
    served: bool = Field(description="Whether there is such a worker, so that jobs don't wait")


@router.get("")
def list_simulators(context: ContextDep, paging: PagingDep) -> Page[SimulatorView]:
    """Lists what jobs can name as `simulator`, and whether it is served at the moment."""
    serving = Counter(context.store.workers.counts().serving)
    views = [
        SimulatorView(
            **asdict(simulator),
            default=simulator.name == DEFAULT_ENGINE,
            workers=serving[simulate_queue(simulator.name)],
            served=serving[simulate_queue(simulator.name)] > 0,
        )
        for simulator in known_simulators(context).values()
    ]
    return Page[SimulatorView](**paging.of(views))
