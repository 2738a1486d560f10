"""The versions that results depend on, and the constants of the boards' statistics."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import BaseModel, Field

from buildarena_api.dependencies import ContextDep
from buildarena_backend import __version__
from buildarena_backend.trials.known_simulators import known_simulators
from buildarena_benchmark.statistics import ERROR, MIN_SUCCESSES
from buildarena_benchmark.tasks.task import SCORER_VERSION
from buildarena_geometry import FEEDBACK_VERSION

router = APIRouter(prefix="/v1/versions", tags=["catalogue"])


class SimulatorVersion(BaseModel):
    """A simulator and its version, as tracks have them in their names."""

    name: str
    version: str


class VersionsView(BaseModel):
    """What a result depends on besides model and task: results of other versions never mix."""

    buildarena: str = Field(description="Of the service")
    feedback: str = Field(description="Of what builders are answered")
    scorers: int = Field(description="Of how trials are judged; part of each task's version")
    simulators: list[SimulatorVersion]
    family_wise_error_rate: float = Field(
        description="Chance that a board makes any false claim, at most"
    )
    min_successes: int = Field(
        description="Successes below which a mean indicator has no interval, as none would hold"
    )


@router.get("")
def show_versions(context: ContextDep) -> VersionsView:
    """Shows the versions in use, and the constants of the boards' statistics."""
    return VersionsView(
        buildarena=__version__,
        feedback=FEEDBACK_VERSION,
        scorers=SCORER_VERSION,
        simulators=[
            SimulatorVersion(name=simulator.name, version=simulator.version)
            for simulator in known_simulators(context).values()
        ],
        family_wise_error_rate=ERROR,
        min_successes=MIN_SUCCESSES,
    )
