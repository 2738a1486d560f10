"""The task file's format, as pydantic models.

All fields of task files are declared here, so that their schema, errors and hash all come
from one place. A task may come from an untrusted user: it cannot make a trial long or large, and
one that no machine can pass is refused.
"""

import unicodedata
from typing import Annotated, Any, Final, Literal, Protocol

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    field_validator,
)
from pydantic_core import PydanticCustomError

from buildarena_benchmark.families.hidden_parameters import HiddenParameters, sample_scenario
from buildarena_benchmark.families.initial_machine import InitialMachine
from buildarena_benchmark.fields import Count, Document
from buildarena_benchmark.scoring.registry import known_scorers, scoring_type
from buildarena_geometry import (
    MODULE_SETS,
    Catalogue,
    catalogue_of,
    module_set,
    modules_named,
    simulated_modules,
)
from buildarena_simulation import Scenario

MAX_BLOCK_SECONDS: Final = 20_000
"""Most blocks x seconds of a trial: about two minutes of work for the slower engine (measured:
0.005 to 0.006 s a block-second for 300 to 1,000 blocks, 0.013 with three ropes to a block)."""


def _plain(text: str) -> str:
    """Refuse control characters and halves of characters: they steer terminals, break encoders."""
    for character in text:
        if unicodedata.category(character) in {"Cc", "Cs"} and character not in "\n\t":
            raise ValueError(f"has the character {character!r}, which is not text")
    return text


def _known_module(name: str) -> str:
    # Cargo is placed by the scenario, never by a builder.
    simulated = simulated_modules()
    if name not in simulated:
        message = f"unknown module {name!r}"
        if name in module_set("all"):
            message = f"{name!r} can be built, but is not simulated"
        names = sorted(module.name for module in simulated.values())
        raise PydanticCustomError("unknown_module", message, {"choices": names})
    return name


def _known_set(chosen: str) -> str:
    simulated = [name for name in MODULE_SETS if name != "all"]
    if chosen not in simulated:
        message = f"unknown module set {chosen!r}"
        if chosen in MODULE_SETS:
            message = f"the module set {chosen!r} has modules that are not simulated"
        raise PydanticCustomError("unknown_set", message, {"choices": simulated})
    return chosen


Text = Annotated[str, AfterValidator(_plain)]
Word = Annotated[str, Field(pattern=r"^[\w .,/²³·%°-]+$", min_length=1, max_length=60)]
"""Text for tables, plots and TeX: without characters that have a meaning there."""
ModuleName = Annotated[str, AfterValidator(_known_module)]
ModuleSet = Annotated[str, AfterValidator(_known_set)]
ModuleNames = Annotated[tuple[ModuleName, ...], Field(min_length=1, max_length=50)]


_FORMER_LISTS: Final = {"told": "inline", "looked_up": "on_demand"}


class FrameConstraint(Document):
    """Minimum requirements on the sub-structure without cannons.

    Attributes:
        min_blocks: Fewest blocks of each such sub-structure.
        min_mass_share: Least share of the machine's mass in all, connectors that end on them
            included.
    """

    min_blocks: Annotated[int, Field(ge=2, le=1000)]
    min_mass_share: Annotated[float, Field(gt=0, lt=1)]


class Constraints(Document):
    """Constraints on a machine for the task.

    Attributes:
        min_sub_structures: Fewest sub-structures.
        max_sub_structures: Most sub-structures.
        max_blocks: Most blocks per sub-structure, connectors not counted; for the whole machine
            times the allowed number of sub-structures.
        modules: Name of a set, or names of modules; None for the basic set.
        module_list: Whether prompts list all modules, or builders look them up by tools.
        min_modules: Fewest blocks or connectors of a module, by its name.
        max_modules: Most blocks or connectors of a module, by its name.
        min_wheels: Fewest powered wheels; shown to builders, judged by the scorer.
        frame: Rules for a rocket's frame, held by nothing but connectors; None where the task has
            none.
    """

    min_sub_structures: Annotated[int, Field(ge=1, le=20)] = 1
    max_sub_structures: Annotated[int, Field(ge=1, le=20, validate_default=True)] = 1
    max_blocks: Annotated[int, Field(ge=2, le=1000)] = 200
    modules: (
        Annotated[
            Annotated[ModuleSet, Tag("set")] | Annotated[ModuleNames, Tag("names")],
            Discriminator(lambda value: "set" if isinstance(value, str) else "names"),
        ]
        | None
    ) = None
    module_list: Annotated[
        Literal["inline", "on_demand"],
        BeforeValidator(lambda value: _FORMER_LISTS.get(value, value)),
    ] = "inline"
    min_modules: dict[ModuleName, Annotated[int, Field(ge=1, le=1000)]] = Field(default={})
    max_modules: Annotated[
        dict[ModuleName, Annotated[int, Field(ge=0, le=1000)]],
        Field(exclude_if=lambda value: not value),
    ] = Field(default={})
    min_wheels: Count = 0
    frame: Annotated[FrameConstraint | None, Field(exclude_if=lambda value: value is None)] = None

    @property
    def on_demand(self) -> bool:
        """True if builders look modules up by tools instead of reading them in the prompt."""
        return self.module_list == "on_demand"

    @property
    def catalogue(self) -> Catalogue:
        """Catalogue of the allowed modules."""
        return catalogue_of(self.modules)

    @property
    def most_blocks(self) -> int:
        """Most blocks of the whole machine."""
        return self.max_sub_structures * self.max_blocks

    @field_validator("max_sub_structures")
    @classmethod
    def _room_for_the_fewest(cls, maximum: int, info: ValidationInfo) -> int:
        minimum = info.data.get("min_sub_structures", 1)
        if maximum < minimum:
            raise ValueError(f"is {maximum}, less than min_sub_structures, {minimum}")
        return maximum

    @field_validator("min_modules")
    @classmethod
    def _min_modules_are_allowed(
        cls, counts: dict[str, int], info: ValidationInfo
    ) -> dict[str, int]:
        allowed = modules_named(info.data.get("modules"))
        for name in counts:
            if name not in allowed:
                raise ValueError(f"{name} is not among the task's modules")
        return counts


class Scoring(Protocol):
    """Field `scoring` of a task file: a scorer's name with its parameters."""

    @property
    def name(self) -> str:
        """Name of the scorer."""

    def model_dump(self, *, mode: Literal["json"]) -> dict[str, Any]:
        """Return the parameters, defaults included, as JSON values."""


class Indicator(Document):
    """The one figure a task is ranked by.

    Attributes:
        unit: Unit; "1" for a ratio.
    """

    name: Word
    unit: Word

    @property
    def suffix(self) -> str:
        """Suffix of a figure: a blank and the unit, empty for a ratio."""
        return "" if self.unit == "1" else f" {self.unit}"


class TaskDocument(Document):
    """A task file; see `Task` for what the fields mean."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=60)]
    title: Annotated[Text, Field(min_length=1, max_length=120)]
    category: Annotated[str, Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=40)]
    level: Annotated[int, Field(ge=1, le=9)] = 1
    statement: Annotated[Text, Field(min_length=1, max_length=20_000)]
    constraints: Constraints = Constraints()
    initial_machine: Annotated[
        InitialMachine | None, Field(exclude_if=lambda value: value is None)
    ] = None
    scenario: Scenario
    hidden_parameters: Annotated[
        HiddenParameters | None, Field(exclude_if=lambda value: value is None)
    ] = None
    test_trials: Annotated[int, Field(ge=0, le=20, exclude_if=lambda value: not value)] = 0
    scoring: scoring_type()  # type: ignore[valid-type]  # known when the registry is read
    indicator: Indicator

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

    @field_validator("hidden_parameters")
    @classmethod
    def _draws_can_be_simulated(
        cls, hidden_parameters: HiddenParameters | None, info: ValidationInfo
    ) -> HiddenParameters | None:
        scenario: Scenario | None = info.data.get("scenario")
        if hidden_parameters is not None and scenario is not None:
            if scenario.control.mode != "agent":
                raise ValueError("hidden parameters need scenario.control.mode agent")
            for end in (0, 1):
                sample_scenario(hidden_parameters.at_end(end), scenario, seed=0)
        return hidden_parameters

    @field_validator("scoring")
    @classmethod
    def _somebody_could_pass(cls, scoring: Scoring, info: ValidationInfo) -> Scoring:
        scenario: Scenario | None = info.data.get("scenario")
        if scenario is None:
            return scoring
        for world in (scenario, *scenario.ends):
            problem = known_scorers()[scoring.name].infeasible(scoring, world)
            if problem is not None:
                raise ValueError(problem)
        return scoring
