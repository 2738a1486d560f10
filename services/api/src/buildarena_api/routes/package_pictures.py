"""Routes of what a challenge's packages look like, and of who changed what in a season."""

from __future__ import annotations

from fastapi import APIRouter, Depends
from pydantic import BaseModel, Field

from buildarena_api.dependencies import ContextDep
from buildarena_api.http.access import CallerDep, admin_only
from buildarena_api.http.concurrency import limited
from buildarena_api.http.problems import ProblemError, problem_responses
from buildarena_api.routes.challenges import (
    PackageChangeView,
    PackageId,
    SeasonsDep,
    require_sight,
    season_of,
)
from buildarena_api.scenes import MachineScene, Vector, machine_scene
from buildarena_pipeline.challenges.findings import CheckFailed
from buildarena_pipeline.challenges.showing import shown_package
from buildarena_store.package_values import RANKED

router = APIRouter(prefix="/v1", tags=["challenges"])
_ORDINARY = [limited("ordinary")]


class FlightView(BaseModel):
    """Where a package's tracked block was."""

    time_s: list[float] = Field(description="Seconds")
    places: list[Vector] = Field(description="World frame (x east, y north, z up), units")
    center: Vector | None = Field(description="Of the planet; null where it is not known")


class PackagePicture(BaseModel):
    """What a package looks like."""

    machines: dict[str, MachineScene] = Field(description="By the names of their files")
    flight: FlightView | None = Field(description="null where its season has none")


class SeasonChangeView(PackageChangeView):
    """Who changed a package of a season, and why."""

    package: str
    name: str = Field(description="Of the entry")


@router.get(
    "/submissions/{package}/picture",
    dependencies=_ORDINARY,
    responses=problem_responses(403, 404, 409, 422, 503),
)
def package_picture(
    package: PackageId, seasons: SeasonsDep, context: ContextDep, caller: CallerDep
) -> PackagePicture:
    """Machines and flight of a package that passed its checks, for those who may see it."""
    stored = context.store.packages.show(package)
    require_sight(stored, seasons, caller)
    if stored.state not in RANKED:
        raise ProblemError(409, f"{package} is {stored.state}: only what passed is shown")
    try:
        shown = shown_package(context.artifacts.get(stored.hash), season_of(seasons, stored.season))
    except CheckFailed as error:
        raise ProblemError(409, str(error)) from error
    flight = shown.flight
    return PackagePicture(
        machines={name: machine_scene(machine) for name, machine in shown.machines.items()},
        flight=None
        if flight is None
        else FlightView(
            time_s=flight.time_s.tolist(), places=flight.places.tolist(), center=flight.center
        ),
    )


@router.get(
    "/seasons/{name}/changes",
    dependencies=[*_ORDINARY, Depends(admin_only)],
    responses=problem_responses(404, 503),
)
def season_changes(name: str, seasons: SeasonsDep, context: ContextDep) -> list[SeasonChangeView]:
    """Who decided what of a season's packages, the last change first. For admins."""
    season = season_of(seasons, name)
    return [
        SeasonChangeView.model_validate(change, from_attributes=True)
        for change in context.store.packages.season_changes(season.name)
    ]
