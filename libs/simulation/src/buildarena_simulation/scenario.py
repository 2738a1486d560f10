"""What a machine is put through: terrain, cargo, placement, control and duration.

A scenario is a document (it is read from task files and hashed into task versions), so it is a
frozen pydantic model: everything it does not know is refused, with the field's name. Task files
may come from strangers, so every number has bounds within which the engines stay sound.
"""

import math
from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from buildarena_simulation.constants import SAMPLE_RATE_HZ

MAX_DURATION_S: Final = 600.0

Coordinate = Annotated[float, Field(allow_inf_nan=False, ge=-1e4, le=1e4)]
Distance = Annotated[float, Field(gt=0, le=1000)]
TerrainExtent = Annotated[float, Field(ge=0.1, le=1000)]
CargoExtent = Annotated[float, Field(ge=0.1, le=100)]
Mass = Annotated[float, Field(ge=0.01, le=100_000)]
Instant = Annotated[float, Field(ge=0, le=MAX_DURATION_S)]
BlockId = Annotated[str, Field(min_length=1, max_length=40)]


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class TerrainBox(_Document):
    """A fixed box.

    Attributes:
        center: (3,) world frame, units.
        size: (3,) full extents along its own axes: east, north and up before it is tilted, units.
        slope_deg: Tilt about the east-west axis through its centre, degrees; above 0 its top rises
            towards the north.
    """

    center: tuple[Coordinate, Coordinate, Coordinate]
    size: tuple[TerrainExtent, TerrainExtent, TerrainExtent]
    slope_deg: Annotated[float, Field(gt=-90, lt=90)] = 0.0


class Cargo(_Document):
    """A loose box that is dropped onto the machine and grows heavier.

    Attributes:
        size: (3,) full extents along east, north and up, units.
        drop_height: Height of its underside above the machine's top at the start, units.
        initial_mass: Mass from which the ramp starts, mass units.
        final_mass: Mass at the ramp's end, mass units.
        ramp_start_s: When the ramp starts, seconds.
        ramp_s: How long the ramp lasts, seconds.
    """

    size: tuple[CargoExtent, CargoExtent, CargoExtent]
    drop_height: Annotated[float, Field(ge=0, le=100)] = 3.0
    initial_mass: Mass = 5.0
    final_mass: Mass
    ramp_start_s: Instant = 0.5
    ramp_s: Annotated[float, Field(gt=0, le=MAX_DURATION_S)]

    def mass_at(self, time_s: float) -> float:
        """Mass of the cargo at a time, mass units.

        Source: the published runner's mass script; the ramp never falls below 0.005 of its height.
        """
        share = min(max((time_s - self.ramp_start_s) / self.ramp_s, 0.005), 1.0)
        return self.initial_mass + (self.final_mass - self.initial_mass) * share


class GroundPlacement(_Document):
    """The machine stands on the ground, its starting block above (0, 0)."""

    kind: Literal["ground"] = "ground"


class SpanPlacement(_Document):
    """The machine is released above a gap, its bounding box centred on (0, 0).

    Attributes:
        gap: Width of the gap along north-south, units; a machine that is longer than the gap only
            along east-west is turned by 90° about the vertical.
        lowest_center: Height of its lowest block's centre at the start, units.
    """

    kind: Literal["span"] = "span"
    gap: Distance
    lowest_center: Distance = 6.0


class Control(_Document):
    """Who presses the keys.

    Attributes:
        mode: "agent": the machine's control sequence; "held": every cannon fires from `from_s` on;
            "none": nothing is pressed.
        from_s: When held cannons start to fire, seconds.
    """

    mode: Literal["agent", "held", "none"] = "none"
    from_s: Instant = 0.0


class Scenario(_Document):
    """Everything about a trial but the machine and the engine.

    The world frame is x east, y north, z up; the ground is the plane z = 0.

    Attributes:
        duration_s: Length of the trial, seconds.
        terrain: Fixed boxes besides the ground.
        cargo: The cargo, if the trial has one.
        placement: Where the machine is put.
        control: Who presses the keys.
        tracked_blocks: Ids of the blocks whose poses are recorded, or "all".
    """

    duration_s: Annotated[float, Field(gt=0, le=MAX_DURATION_S)]
    terrain: Annotated[tuple[TerrainBox, ...], Field(max_length=64)] = ()
    cargo: Cargo | None = None
    placement: Annotated[GroundPlacement | SpanPlacement, Field(discriminator="kind")] = (
        GroundPlacement()
    )
    control: Control = Control()
    tracked_blocks: (
        Literal["all"] | Annotated[tuple[BlockId, ...], Field(min_length=1, max_length=1000)]
    ) = "all"

    @model_validator(mode="after")
    def _duration_is_whole_samples(self) -> Self:
        samples = self.duration_s * SAMPLE_RATE_HZ
        if not math.isclose(samples, round(samples), abs_tol=1e-9):
            raise ValueError(
                f"duration_s {self.duration_s} is not a multiple of {1 / SAMPLE_RATE_HZ} s"
            )
        return self

    @property
    def sample_count(self) -> int:
        """Number of recorded instants, the start included."""
        return round(self.duration_s * SAMPLE_RATE_HZ) + 1


def gap_terrain(
    gap: float, *, height: float = 5.0, width: float = 30.0, length: float = 20.0
) -> tuple[TerrainBox, ...]:
    """Two fixed terrains that leave a gap along north-south, their tops at `height`.

    Args:
        gap: Distance of the two edges, which lie at y = ±gap / 2, units.
        height: Height of both tops, units.
        width: Extent of each terrain along east-west, units.
        length: Extent of each terrain along north-south, units.

    Returns:
        The southern and the northern box.

    Source: the paper, task details of Support.
    """
    offset = gap / 2 + length / 2
    return tuple(
        TerrainBox(center=(0.0, side * offset, height / 2), size=(width, length, height))
        for side in (-1.0, 1.0)
    )
