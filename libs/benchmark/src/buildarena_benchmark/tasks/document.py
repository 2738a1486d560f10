"""The task file's format, as pydantic models.

Whatever a task file may say is declared here, so that its schema, its errors and its hash all come
from one place.
"""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from buildarena_simulation import Scenario

Weight = Annotated[int, Field(ge=1, le=3)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Constraints(_Document):
    """What a machine for the task may be made of.

    Attributes:
        min_sub_structures: Fewest sub-structures.
        max_sub_structures: Most sub-structures.
        max_blocks: Most blocks per sub-structure, connectors not counted.
        modules: Names of the modules that may be used; None for all.
        min_wheels: Fewest powered wheels.
    """

    min_sub_structures: Annotated[int, Field(ge=1)] = 1
    max_sub_structures: Annotated[int, Field(ge=1)] = 1
    max_blocks: Annotated[int, Field(ge=1, le=1000)] = 200
    modules: tuple[str, ...] | None = None
    min_wheels: Annotated[int, Field(ge=0)] = 0


class TransportScoring(_Document):
    """How far something is moved over the ground.

    Attributes:
        subject: Whose horizontal distance from its start counts.
        min_distance: The indicator must exceed it, units.
        min_wheels: Fewest wheels of a machine that passes.
        max_start_height: The highest start position must lie below it, units.
        target: (2,) where to go, units; for secondary metrics only.
    """

    name: Literal["transport"]
    subject: Literal["starting_block", "cargo"]
    min_distance: NonNegative = 10.0
    min_wheels: Annotated[int, Field(ge=0)] = 0
    max_start_height: NonNegative = 20.0
    target: tuple[Finite, Finite] = (10.0, 10.0)


class SupportScoring(_Document):
    """How heavy a cargo is carried over a gap.

    Attributes:
        fall_height: The cargo has fallen when its centre is below it, units.
        min_time_s: How long in all it must be at or above that height.
        max_start_height: Its start height may not exceed it, units.
    """

    name: Literal["support"]
    fall_height: NonNegative = 4.0
    min_time_s: NonNegative = 2.0
    max_start_height: NonNegative = 20.0


class ThrustScoring(_Document):
    """Thrust over weight.

    Attributes:
        min_ratio: The indicator must exceed it.
    """

    name: Literal["thrust"]
    min_ratio: NonNegative = 1.0


class HeightScoring(_Document):
    """How high a rocket rises.

    Attributes:
        min_height: The indicator must exceed it, units.
        early_s: (2,) first window, seconds, its start excluded.
        late_s: (2,) second window.
        min_rise: The mean height must rise by more from window to window, units.
    """

    name: Literal["height"]
    min_height: NonNegative = 30.0
    early_s: tuple[NonNegative, NonNegative] = (2.0, 7.0)
    late_s: tuple[NonNegative, NonNegative] = (7.0, 12.0)
    min_rise: NonNegative = 5.0


Scoring = Annotated[
    TransportScoring | SupportScoring | ThrustScoring | HeightScoring,
    Field(discriminator="name"),
]


class Indicator(_Document):
    """The one figure a task is ranked by.

    Attributes:
        name: What it is called.
        unit: Its unit; "1" for a ratio.
    """

    name: str
    unit: str


class Difficulty(_Document):
    """Weight of each difficulty dimension, 1 (low) to 3 (high)."""

    quantification: Weight
    robustness: Weight
    magnitude: Weight
    compositionality: Weight
    precision: Weight
    ambiguity: Weight


class TaskDocument(_Document):
    """A task file; see `Task` for what the fields mean."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=60)]
    title: Annotated[str, Field(min_length=1, max_length=120)]
    category: Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=40)]
    level: Annotated[int, Field(ge=1, le=9)] = 1
    statement: Annotated[str, Field(min_length=1, max_length=20_000)]
    constraints: Constraints = Constraints()
    scenario: Scenario
    scoring: Scoring
    indicator: Indicator
    difficulty: Difficulty | None = None
