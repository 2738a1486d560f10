"""Routes of what can be named besides tasks: models and modules."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import BaseModel, Field

from buildarena_api.dependencies import RegistryDep
from buildarena_geometry import load_catalogue

router = APIRouter(prefix="/v1", tags=["catalogue"])


class ModelView(BaseModel):
    """A model that jobs can name."""

    name: str = Field(examples=["openai/gpt-5"])
    provider: str
    model: str = Field(description="The provider's own name of the snapshot")
    baseline: bool


class ModuleView(BaseModel):
    """A module that machines are made of."""

    name: str
    kind: str
    mass: float
    cost: float
    description: str
    size: tuple[float, float, float] | None = Field(
        description="Extents along its own x, y and z, units; null for connectors"
    )
    faces: list[str] = Field(description="Labels of the faces that take a block")
    actions: list[str] = Field(description="What keys can be bound to")


@router.get("/models")
def list_models(registry: RegistryDep) -> list[ModelView]:
    """Lists the models of the registry."""
    return [
        ModelView(name=m.name, provider=m.provider, model=m.model, baseline=m.baseline)
        for m in registry.models.values()
    ]


@router.get("/modules")
def list_modules() -> list[ModuleView]:
    """Lists the basic modules."""
    return [
        ModuleView(
            name=m.name,
            kind=m.kind,
            mass=m.mass,
            cost=m.cost,
            description=m.description,
            size=m.size,
            faces=[face.label for face in m.faces],
            actions=list(m.actions),
        )
        for m in load_catalogue().values()
    ]
