"""The task file's format, as pydantic models.

Whatever a task file may say is declared here, so that its schema, its errors and its hash all come
from one place. A task may come from a stranger: what it says cannot make a trial long or large,
and what nobody could ever pass is refused.
"""

import unicodedata
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from buildarena_benchmark.tasks.fields import Coordinate, Count, Document, Threshold
from buildarena_benchmark.tasks.workshop_scoring import WorkshopScoring, hopeless
from buildarena_geometry import (
    MODULE_SETS,
    Catalogue,
    catalogue_of,
    module_set,
    modules_named,
)
from buildarena_simulation import Scenario

MAX_BLOCK_SECONDS: Final = 20_000
"""Most blocks x seconds of a trial: about two minutes of work for the slower engine (measured:
0.005 to 0.006 s a block-second for 300 to 1,000 blocks, 0.013 with three ropes to a block)."""


def _plain(text: str) -> str:
    """Refuses control characters and halves of characters: they steer terminals, break encoders."""
    for character in text:
        if unicodedata.category(character) in {"Cc", "Cs"} and character not in "\n\t":
            raise ValueError(f"has the character {character!r}, which is not text")
    return text


def _known_module(name: str) -> str:
    # Cargo is placed by the scenario, never by a builder.
    simulated = module_set("workshop")
    if name not in simulated:
        message = f"there is no module {name!r}"
        if name in module_set("all"):
            message = f"{name!r} can be built, but is not simulated"
        known = sorted(module.name for module in simulated.values())
        raise PydanticCustomError("unknown_module", message, {"choices": known})
    return name


def _known_set(chosen: str) -> str:
    simulated = [name for name in MODULE_SETS if name != "all"]
    if chosen not in simulated:
        message = f"there is no module set {chosen!r}"
        if chosen in MODULE_SETS:
            message = f"the module set {chosen!r} has modules that are not simulated"
        raise PydanticCustomError("unknown_set", message, {"choices": simulated})
    return chosen


Weight = Annotated[int, Field(ge=1, le=3)]
Text = Annotated[str, AfterValidator(_plain)]
Word = Annotated[str, Field(pattern=r"^[\w .,/²³·%°-]+$", min_length=1, max_length=60)]
"""Stands in tables, plots and TeX: no sign that means something there."""
ModuleName = Annotated[str, AfterValidator(_known_module)]
ModuleSet = Annotated[str, AfterValidator(_known_set)]
ModuleNames = Annotated[tuple[ModuleName, ...], Field(min_length=1, max_length=50)]


class Constraints(Document):
    """What a machine for the task may be made of.

    Attributes:
        min_sub_structures: Fewest sub-structures.
        max_sub_structures: Most sub-structures.
        max_blocks: Most blocks per sub-structure, connectors not counted; the whole machine may
            have as many for each sub-structure that is allowed.
        modules: Which modules may be used: a set's name, or names of modules; None for the basic
            set.
        module_list: Whether builders are told all modules they may use, or look them up by tools.
        min_modules: Fewest blocks or connectors of a module, by its name.
        min_wheels: Fewest powered wheels; shown to builders, judged by the scorer.
    """

    min_sub_structures: Annotated[int, Field(ge=1, le=20)] = 1
    max_sub_structures: Annotated[int, Field(ge=1, le=20, validate_default=True)] = 1
    max_blocks: Annotated[int, Field(ge=2, le=1000)] = 200
    modules: (
        Annotated[
            Annotated[ModuleSet, Tag("set")] | Annotated[ModuleNames, Tag("names")],
            Discriminator(lambda given: "set" if isinstance(given, str) else "names"),
        ]
        | None
    ) = None
    module_list: Literal["told", "looked_up"] = "told"
    min_modules: dict[ModuleName, Annotated[int, Field(ge=1, le=1000)]] = Field(default={})
    min_wheels: Count = 0

    @property
    def looked_up(self) -> bool:
        """Whether builders look modules up by tools instead of being told them."""
        return self.module_list == "looked_up"

    @property
    def catalogue(self) -> Catalogue:
        """What machines are built from."""
        return catalogue_of(self.modules)

    @property
    def most_blocks(self) -> int:
        """Most blocks of the whole machine."""
        return self.max_sub_structures * self.max_blocks

    @field_validator("max_sub_structures")
    @classmethod
    def _room_for_the_fewest(cls, most: int, info: ValidationInfo) -> int:
        least = info.data.get("min_sub_structures", 1)
        if most < least:
            raise ValueError(f"is {most}, less than min_sub_structures, {least}")
        return most

    @field_validator("min_modules")
    @classmethod
    def _wanted_modules_are_allowed(
        cls, wanted: dict[str, int], info: ValidationInfo
    ) -> dict[str, int]:
        allowed = modules_named(info.data.get("modules"))
        for name in wanted:
            if name not in allowed:
                raise ValueError(f"{name} is not among the task's modules")
        return wanted


class TransportScoring(Document):
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
    min_distance: Threshold = 10.0
    min_wheels: Count = 0
    max_start_height: Threshold = 20.0
    target: tuple[Coordinate, Coordinate] = (10.0, 10.0)


class SupportScoring(Document):
    """How heavy a cargo is carried over a gap.

    Attributes:
        fall_height: The cargo has fallen when its centre is below it, units.
        min_time_s: How long in all it must be at or above that height.
        max_start_height: Its start height may not exceed it, units.
    """

    name: Literal["support"]
    fall_height: Threshold = 4.0
    min_time_s: Threshold = 2.0
    max_start_height: Threshold = 20.0


class ThrustScoring(Document):
    """Thrust over weight.

    Attributes:
        min_ratio: The indicator must exceed it.
    """

    name: Literal["thrust"]
    min_ratio: Threshold = 1.0


class HeightScoring(Document):
    """How high a rocket rises.

    Attributes:
        min_height: The indicator must exceed it, units.
        early_s: (2,) first window, seconds, its start excluded.
        late_s: (2,) second window.
        min_rise: The mean height must rise by more from window to window, units.
    """

    name: Literal["height"]
    min_height: Threshold = 30.0
    early_s: tuple[Threshold, Threshold] = (2.0, 7.0)
    late_s: tuple[Threshold, Threshold] = (7.0, 12.0)
    min_rise: Threshold = 5.0


Scoring = Annotated[
    TransportScoring | SupportScoring | ThrustScoring | HeightScoring | WorkshopScoring,
    Field(discriminator="name"),
]


class Indicator(Document):
    """The one figure a task is ranked by.

    Attributes:
        name: What it is called.
        unit: Its unit; "1" for a ratio.
    """

    name: Word
    unit: Word


class Difficulty(Document):
    """Weight of each difficulty dimension, 1 (low) to 3 (high)."""

    quantification: Weight
    robustness: Weight
    magnitude: Weight
    compositionality: Weight
    precision: Weight
    ambiguity: Weight


class TaskDocument(Document):
    """A task file; see `Task` for what the fields mean."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=60)]
    title: Annotated[Text, Field(min_length=1, max_length=120)]
    category: Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=40)]
    level: Annotated[int, Field(ge=1, le=9)] = 1
    statement: Annotated[Text, Field(min_length=1, max_length=20_000)]
    constraints: Constraints = Constraints()
    scenario: Scenario
    scoring: Scoring
    indicator: Indicator
    difficulty: Difficulty | None = None

    @field_validator("scenario")
    @classmethod
    def _trial_is_bounded(cls, scenario: Scenario, info: ValidationInfo) -> Scenario:
        constraints: Constraints | None = info.data.get("constraints")
        if constraints is None:
            return scenario
        size = constraints.most_blocks * scenario.duration_s
        if size > MAX_BLOCK_SECONDS:
            raise ValueError(
                f"duration_s {scenario.duration_s:g} with up to {constraints.max_sub_structures} x "
                f"{constraints.max_blocks} blocks makes {size:,.0f} block-seconds; "
                f"at most {MAX_BLOCK_SECONDS:,} are simulated"
            )
        return scenario

    @field_validator("scoring")
    @classmethod
    def _somebody_could_pass(cls, scoring: Scoring, info: ValidationInfo) -> Scoring:
        scenario: Scenario | None = info.data.get("scenario")
        if scenario is None:
            return scoring
        if isinstance(scoring, WorkshopScoring):
            problem = hopeless(scoring, scenario)
        else:
            problem = _hopeless(scoring, scenario)
        if problem is not None:
            raise ValueError(problem)
        return scoring


def _hopeless(scoring: Scoring, scenario: Scenario) -> str | None:
    """Why no machine can pass: the scorer asks for what the scenario does not have."""
    wants_cargo = isinstance(scoring, SupportScoring) or (
        isinstance(scoring, TransportScoring) and scoring.subject == "cargo"
    )
    mode, problem = scenario.control.mode, None
    if wants_cargo and scenario.cargo is None:
        problem = "the cargo is judged, but scenario has no cargo"
    elif isinstance(scoring, TransportScoring) and mode != "agent":
        problem = "a vehicle is judged, but nobody drives: scenario.control.mode must be agent"
    elif isinstance(scoring, SupportScoring) and scoring.min_time_s > scenario.duration_s:
        problem = f"min_time_s {scoring.min_time_s:g} is longer than the trial"
    elif isinstance(scoring, HeightScoring):
        (start, end), (later, last) = scoring.early_s, scoring.late_s
        if mode == "none":
            problem = "a rocket is judged, but nothing fires: scenario.control.mode must be held"
        elif not start < end <= later < last <= scenario.duration_s:
            problem = "early_s and late_s must be windows within the trial, one after the other"
    return problem
