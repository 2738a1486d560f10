"""Routes of what can be named besides tasks: models, modules and scorers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from buildarena_api.dependencies import ContextDep, RegistryDep
from buildarena_api.http.codes import ErrorCode
from buildarena_api.http.pages import Page, PagingDep
from buildarena_api.http.problems import ProblemError, invalid
from buildarena_api.leaderboard.views import FlagView
from buildarena_benchmark.scoring.registry import known_scorers
from buildarena_geometry import module_set
from buildarena_geometry.modules.module import Face

router = APIRouter(prefix="/v1", tags=["catalogue"])


def _labels(faces: Iterable[Face]) -> list[str]:
    return [face.label for face in faces]


class _View(BaseModel):
    model_config = ConfigDict(from_attributes=True)


class ModelView(_View):
    """A model that jobs can name."""

    name: str = Field(examples=["openai/gpt-5"])
    provider: str
    model: str = Field(description="The provider's own name of the snapshot")
    baseline: bool


class ModuleView(_View):
    """A module that machines are made of."""

    name: str
    kind: str
    mass: float
    cost: float
    description: str
    size: tuple[float, float, float] | None = Field(
        description="Extents along its own x, y and z, units; null for connectors"
    )
    faces: Annotated[list[str], BeforeValidator(_labels)] = Field(
        description="Labels of the faces that take a block"
    )
    actions: list[str] = Field(description="What keys can be bound to")
    categories: list[str] = Field(description="Groups it is looked up in; none for basic modules")
    simulated: bool = Field(description="Whether both engines have its physics")


class ScorerView(_View):
    """A scorer that task files can name."""

    name: str = Field(examples=["support"])
    description: str = Field(description="What its indicator is")
    parameters: Annotated[dict[str, Any], BeforeValidator(lambda m: m.model_json_schema())] = Field(
        description="JSON schema of what a task file says under `scoring`"
    )
    flags: list[FlagView]


@router.get("/models")
def list_models(registry: RegistryDep, paging: PagingDep) -> Page[ModelView]:
    """Lists the models of the registry."""
    return Page[ModelView].model_validate(paging.of(list(registry.models.values())))


@router.get("/modules")
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
    """Lists modules: the basic ones, those of a set, or those that a task allows."""
    if task is not None and set_ is not None:
        raise _contradictory("set", "pass either `set` or `task`, not both")
    if task is None and version is not None:
        raise _contradictory("version", "requires `task`")
    catalogue = (
        module_set(set_ or "basic")
        if task is None
        else context.tasks.find(task, version).task.constraints.catalogue
    )
    return Page[ModuleView].model_validate(paging.of(list(catalogue.values())))


@router.get("/scorers")
def list_scorers(paging: PagingDep) -> Page[ScorerView]:
    """Lists the scorers that task files can name, with their parameters and flags."""
    return Page[ScorerView].model_validate(paging.of(list(known_scorers().values())))


def _contradictory(field: str, message: str) -> ProblemError:
    return invalid(field, message, code=ErrorCode.CONTRADICTORY_PARAMETERS)
