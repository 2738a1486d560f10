"""Scenario of a trial: terrain, cargo, placement, control and duration.

A scenario is a document (it is read from task files and hashed into task versions), so it is a
frozen pydantic model: unknown fields are refused by name. Task files may be untrusted, so every
number has bounds within which the engines are stable.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from buildarena_simulation.constants import GRAVITY, SAMPLE_RATE_HZ
from buildarena_simulation.fields import (
    MAX_DURATION_S,
    BlockId,
    CargoExtent,
    Coordinate,
    Distance,
    Gravity,
    Heading,
    Instant,
    Label,
    Mass,
    Period,
    PushSpeed,
    Speed,
    Strength,
    Swing,
    TerrainExtent,
    is_default,
)
from buildarena_simulation.line import Line
from buildarena_simulation.randomization import Randomization, at_end, randomize
from buildarena_simulation.sensor_config import Senses
from buildarena_simulation.terrain_shapes import with_boxes


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class TerrainBox(_Document):
    """A fixed box.

    Attributes:
        center: (3,) world frame, units.
        size: (3,) full extents along its own axes: east, north and up before it is tilted, units.
        slope_deg: Tilt about the east-west axis through its centre, degrees; above 0 its top rises
            towards the north.
        heading_deg: By how much it is turned about the vertical after that, from north towards
            east, degrees.
    """

    center: tuple[Coordinate, Coordinate, Coordinate]
    size: tuple[TerrainExtent, TerrainExtent, TerrainExtent]
    slope_deg: Annotated[float, Field(gt=-90, lt=90)] = 0.0
    heading_deg: Heading = 0.0


class Cargo(_Document):
    """A loose box or ball, dropped onto the machine or put at a position, that may grow heavier.

    Attributes:
        size: (3,) full extents along east, north and up, units.
        drop_height: Height of its underside above the machine's top at the start, units; ignored if
            `at` is given.
        initial_mass: Mass from which the ramp starts, mass units.
        final_mass: Mass at the ramp's end, mass units.
        ramp_start_s: Start of the ramp, seconds.
        ramp_s: Duration of the ramp, seconds.
        at: (3,) the middle of its underside at the start, world frame, units; None above the
            machine, over (0, 0).
        heading_deg: Rotation about the vertical, from north towards east, degrees.
        shape: "ball" for one whose diameter the size gives three times.
    """

    size: tuple[CargoExtent, CargoExtent, CargoExtent]
    drop_height: Annotated[float, Field(ge=0, le=100)] = 3.0
    initial_mass: Mass = 5.0
    final_mass: Mass
    ramp_start_s: Instant = 0.5
    ramp_s: Annotated[float, Field(gt=0, le=MAX_DURATION_S)]
    at: Annotated[
        tuple[Coordinate, Coordinate, Annotated[float, Field(ge=0, le=1000)]] | None,
        Field(exclude_if=is_default),
    ] = None
    heading_deg: Heading = 0.0
    shape: Annotated[Literal["box", "ball"], Field(exclude_if=lambda value: value == "box")] = "box"

    @model_validator(mode="after")
    def _balls_are_round(self) -> Self:
        if self.shape == "ball" and len(set(self.size)) > 1:
            raise ValueError(f"a ball's size is its diameter three times, not {list(self.size)}")
        return self

    def mass_at(self, time_s: float) -> float:
        """Return the mass of the cargo at a time, mass units.

        Source: the published runner's mass script; the ramp never falls below 0.005 of its height.
        """
        share = min(max((time_s - self.ramp_start_s) / self.ramp_s, 0.005), 1.0)
        return self.initial_mass + (self.final_mass - self.initial_mass) * share


class GroundPlacement(_Document):
    """Placement on the ground, the starting block above (0, 0).

    Attributes:
        tilt_deg: Rotation at the start about the axis to the east, degrees; if positive, its top
            leans towards the north.
        heading_deg: Rotation about the vertical before that, degrees; its north as built turns
            towards east.
    """

    kind: Literal["ground"] = "ground"
    tilt_deg: Annotated[float, Field(ge=-90, le=90, exclude_if=lambda value: value == 0)] = 0.0
    heading_deg: Heading = 0.0


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


class ReleasedPlacement(_Document):
    """Release in the air, the starting block above (0, 0), with a velocity.

    Attributes:
        height: Height of its lowest point above the ground at the start, units.
        velocity: (3,) of every block at the start, world frame, units/s.
    """

    kind: Literal["released"] = "released"
    height: Distance
    velocity: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)


Placement = GroundPlacement | SpanPlacement | ReleasedPlacement


class Gate(_Document):
    """A line on the ground to be crossed; it is shown and cannot be touched.

    Attributes:
        center: (2,) its middle, world frame, units.
        half_width: Distance from its middle to either end, units.
        heading_deg: Direction in which it is crossed, from north towards east, degrees.
    """

    name: Label
    center: tuple[Coordinate, Coordinate]
    half_width: Distance
    heading_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0


class Drift(_Document):
    """Motion of a mark: along each axis it oscillates about its centre, and starts there.

    Attributes:
        swing: (3,) amplitude, units; if negative, it first moves in the negative direction.
        period_s: (3,) period, seconds.
    """

    swing: tuple[Swing, Swing, Swing]
    period_s: tuple[Period, Period, Period]


class Mark(_Document):
    """A point in the world; it is shown and cannot be touched.

    Attributes:
        center: (3,) world frame, units; of a moving one at the start.
        radius: Around its centre, units.
        drift: Its motion; None if it stays.
    """

    name: Label
    center: tuple[Coordinate, Coordinate, Coordinate]
    radius: Distance
    drift: Annotated[Drift | None, Field(exclude_if=is_default)] = None

    def at(self, time_s: float) -> tuple[float, float, float]:
        """Return its position at a time, (3,), world frame, units."""
        if self.drift is None:
            return self.center
        drifts = zip(self.center, self.drift.swing, self.drift.period_s, strict=True)
        x, y, z = (
            middle + swing * math.sin(2 * math.pi * time_s / period)
            for middle, swing, period in drifts
        )
        return x, y, z


class Control(_Document):
    """Source of the key presses.

    Attributes:
        mode: "agent": the machine's control sequence; "constant": every cannon fires from `from_s`;
            "none": nothing is pressed.
        from_s: Time from which "constant" fires, seconds.
        until_s: Time at which every key is released for good, seconds; None for never.
    """

    mode: Literal["agent", "constant", "none"] = "none"
    from_s: Instant = 0.0
    until_s: Annotated[Instant | None, Field(exclude_if=is_default)] = None


class Gusts(_Document):
    """Wind that accelerates everything sideways by the same amount, different for each seed.

    Attributes:
        strength: Maximum acceleration, units/s².
        shortest_s: Period of its quickest part, seconds; the slowest has four times as long.
    """

    strength: Annotated[float, Field(gt=0, le=20)]
    shortest_s: Annotated[float, Field(ge=0.5, le=60)] = 2.0


class Push(_Document):
    """A short push that accelerates everything equally, evenly over 0.2 s.

    Attributes:
        at_s: Its beginning, seconds.
        velocity: (2,) change of every velocity, to the east and to the north, units/s.
    """

    at_s: Instant
    velocity: tuple[PushSpeed, PushSpeed]


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


class Scenario(_Document):
    """All conditions of a trial except the machine and the engine.

    The world frame is x east, y north, z up; the ground is the plane z = 0, or a planet's.

    Attributes:
        duration_s: Length of the trial, seconds.
        terrain: Fixed boxes besides the ground; task files may write pipes and cylinders, see
            `buildarena_simulation.terrain_shapes`.
        cargo: The cargo, if the trial has one.
        placement: Pose of the machine at the start.
        tracked_blocks: Ids of the blocks whose poses are recorded, or "all".
        gates: Lines to be crossed, in order.
        marks: Places.
        line: A line on the ground; None without one.
        clear_start: True to refuse a machine that overlaps terrain or cargo at the start.
        gravity: Downward acceleration, units/s². The unit of forces remains the weight of one mass
            unit at the usual gravity: the strength of joints and drives does not change.
        drive_strength: Strength of drives as a share of their data: the torque of motors, the force
            and torque of driven joints, the push of fans.
        senses: Senses of a controller; None if none is allowed.
        gusts: Wind; None without. A trial without a seed has the wind of seed 0.
        pushes: Pushes.
        fuel_s: Number of seconds for which fans and cannons can hold the machine's weight: their
            commanded push is added up, and ends once it exceeds this. None for no limit.
        planet: Planet in place of flat ground; None for flat ground. It has no terrain, cargo or
            other objects that need a plane.
        randomization: Ranges of parameters that the trial's seed draws, see
            `buildarena_simulation.randomization`; a trial without a seed has the figures of this
            scenario.
    """

    duration_s: Annotated[float, Field(gt=0, le=MAX_DURATION_S)]
    terrain: Annotated[
        tuple[TerrainBox, ...], Field(max_length=64), BeforeValidator(with_boxes)
    ] = ()
    cargo: Cargo | None = None
    placement: Annotated[Placement, Field(discriminator="kind")] = GroundPlacement()
    control: Control = Control()
    tracked_blocks: (
        Literal["all"] | Annotated[tuple[BlockId, ...], Field(min_length=1, max_length=1000)]
    ) = "all"
    gates: Annotated[tuple[Gate, ...], Field(max_length=64, exclude_if=is_default)] = ()
    marks: Annotated[tuple[Mark, ...], Field(max_length=64, exclude_if=is_default)] = ()
    line: Annotated[Line | None, Field(exclude_if=is_default)] = None
    clear_start: Annotated[bool, Field(exclude_if=is_default)] = False
    gravity: Annotated[Gravity, Field(exclude_if=lambda value: value == GRAVITY)] = GRAVITY
    drive_strength: Annotated[Strength, Field(exclude_if=lambda value: value == 1)] = 1.0
    senses: Annotated[Senses | None, Field(exclude_if=is_default)] = None
    gusts: Annotated[Gusts | None, Field(exclude_if=is_default)] = None
    pushes: Annotated[tuple[Push, ...], Field(max_length=64, exclude_if=is_default)] = ()
    fuel_s: Annotated[Instant | None, Field(exclude_if=is_default)] = None
    planet: Annotated[Planet | None, Field(exclude_if=is_default)] = None
    randomization: Annotated[Randomization, Field(exclude_if=is_default)] = {}

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        for named in (self.gates, self.marks):
            names = [place.name for place in named]
            twice = next((name for name in names if names.count(name) > 1), None)
            if twice is not None:
                raise ValueError(f"the name {twice!r} is used for two places")
        return self

    @model_validator(mode="after")
    def _planets_are_bare(self) -> Self:
        flat = ("terrain", "cargo", "gates", "line", "gusts", "pushes", "fuel_s")
        extras = [name for name in flat if getattr(self, name)]
        if self.placement.kind == "span":
            extras.append("placement.kind span")
        if self.planet is not None and extras:
            raise ValueError(f"a planet has no flat ground, so it goes without {extras[0]}")
        return self

    @model_validator(mode="after")
    def _duration_is_whole_samples(self) -> Self:
        samples = self.duration_s * SAMPLE_RATE_HZ
        if not math.isclose(samples, round(samples), abs_tol=1e-9):
            raise ValueError(
                f"duration_s {self.duration_s} is not a multiple of {1 / SAMPLE_RATE_HZ} s"
            )
        return self

    @model_validator(mode="after")
    def _ranges_can_be_simulated(self) -> Self:
        try:
            _ = self.ends  # making them is the check
        except ValidationError as error:
            wrong = error.errors()[0]
            place = ".".join(map(str, wrong["loc"]))
            raise ValueError(
                f"randomization: at the end of a range, {place}: {wrong['msg']}"
            ) from error
        return self

    @property
    def ends(self) -> tuple[Self, ...]:
        """The worlds with the least figures of all that is drawn, and with the greatest."""
        if not self.randomization:
            return ()
        return tuple(self._world(at_end(self._fixed(), self.randomization, end)) for end in (0, 1))

    def world(self, seed: int | None) -> Self:
        """Return the scenario of a trial with this seed, without randomized parameters.

        Args:
            seed: Seed of the trial; None for the figures of this scenario.
        """
        if not self.randomization:
            return self
        fixed = self._fixed()
        return self._world(fixed if seed is None else randomize(fixed, self.randomization, seed))

    def _fixed(self) -> dict[str, Any]:
        """Return this scenario's figures as JSON values, including defaults."""
        fixed = self.model_dump(mode="json", exclude={"randomization"})
        return {"gravity": self.gravity, "drive_strength": self.drive_strength} | fixed

    def _world(self, document: dict[str, Any]) -> Self:
        return type(self).model_validate(document)

    @property
    def sample_count(self) -> int:
        """Number of recorded instants, the start included."""
        return round(self.duration_s * SAMPLE_RATE_HZ) + 1
