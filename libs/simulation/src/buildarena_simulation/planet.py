"""A planet, as scenarios describe it."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class Planet(BaseModel):
    """A ball in place of flat ground; (0, 0, 0) is on top of it.

    Its pull falls with the square of the distance from its centre, and is the scenario's gravity on
    its ground. Its air thins out evenly with the height.

    Attributes:
        radius: Units.
        air: Drag of its air on the ground, as a share of the usual one.
        air_height: Height at which the air ends, units.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    radius: Annotated[float, Field(ge=100, le=10_000)]
    air: Annotated[float, Field(ge=0, le=10)] = 1.0
    air_height: Annotated[float, Field(ge=1, le=10_000)] = 300.0
