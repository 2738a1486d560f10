"""Senses that a task offers a controller, with their noise and delay."""

from collections.abc import Mapping
from typing import Annotated, Final, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field

SenseKind = Literal[
    "pose",
    "axes",
    "blocks",
    "joints",
    "wheels",
    "contacts",
    "cargo",
    "marks",
    "gates",
    "gate",
    "fuel",
    "line",
]
_UNUSUAL: Final = ("axes", "contacts", "gate", "fuel", "line")
_OFFERED: Final = tuple(kind for kind in get_args(SenseKind) if kind not in _UNUSUAL)
NoiseKind = Literal["place", "speed", "axis", "spin", "joint", "joint_speed"]


class Senses(BaseModel):
    """Senses of a controller, with their noise and delay.

    Attributes:
        offers: Kinds of senses.
        noise: Standard deviation of each figure of a kind: positions in units, speeds in units/s,
            components of axes, spins in rad/s, joints in rad or units and their speeds.
        delay_ticks: Delay in ticks of 0.04 s.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    offers: Annotated[tuple[SenseKind, ...], Field(max_length=16)] = _OFFERED
    noise: Mapping[NoiseKind, Annotated[float, Field(ge=0, le=100)]] = {}
    delay_ticks: Annotated[int, Field(ge=0, le=25)] = 0
