"""Hidden parameters: numbers of the world that each job samples and its statement withholds.

The sampled numbers replace the scenario's own, so that running, scoring or repeating a trial does
not depend on them. Builders must not see them: see `docs/security.md`.
"""

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from buildarena_benchmark.fields import Document
from buildarena_simulation import Scenario
from buildarena_simulation.randomization import between

Figure = Annotated[float, Field(gt=0, le=100_000, allow_inf_nan=False)]
Range = tuple[Figure, Figure]
"""Least and greatest; each number between is as likely."""


class HiddenParameters(Document):
    """Hidden numbers of a scenario, each sampled from a range that the statement gives.

    Attributes:
        gravity: Range of `Scenario.gravity`, units/s².
        cargo_mass: Range of the cargo's mass, constant during the trial, mass units.
        drive_strength: Range of `Scenario.drive_strength`.
    """

    gravity: Annotated[Range | None, Field(exclude_if=lambda value: value is None)] = None
    cargo_mass: Annotated[Range | None, Field(exclude_if=lambda value: value is None)] = None
    drive_strength: Annotated[Range | None, Field(exclude_if=lambda value: value is None)] = None

    @model_validator(mode="after")
    def _has_ranges(self) -> Self:
        ranges = {name: getattr(self, name) for name in NAMES}
        if not any(ranges.values()):
            raise ValueError(f"nothing is drawn: give a range for {', '.join(NAMES)}")
        for name, bounds in ranges.items():
            if bounds and bounds[0] >= bounds[1]:
                raise ValueError(f"{name}: lower bound {bounds[0]:g} must be below {bounds[1]:g}")
        return self

    def at_end(self, end: Literal[0, 1]) -> Self:
        """Return the ranges reduced to their least numbers, or to their greatest."""
        ends = {name: getattr(self, name) for name in NAMES}
        return self.model_copy(
            update={name: (bounds[end], bounds[end]) for name, bounds in ends.items() if bounds}
        )


NAMES: Final = ("gravity", "cargo_mass", "drive_strength")


def sample_hidden_parameters(hidden_parameters: HiddenParameters, seed: int) -> dict[str, float]:
    """Return the numbers for a seed, by name; each name is sampled independently."""
    numbers = {}
    for name in NAMES:
        bounds = getattr(hidden_parameters, name)
        if bounds is not None:
            (numbers[name],) = between(name, bounds[:1], bounds[1:], seed)
    return numbers


def sample_scenario(hidden_parameters: HiddenParameters, scenario: Scenario, seed: int) -> Scenario:
    """Return the scenario with its hidden numbers sampled for a seed.

    Raises:
        ValueError: The scenario does not allow a number, or lacks a cargo for a mass.
    """
    numbers = sample_hidden_parameters(hidden_parameters, seed)
    document = scenario.model_dump(mode="json")
    mass = numbers.pop("cargo_mass", None)
    if mass is not None:
        if scenario.cargo is None:
            raise ValueError("cargo_mass is drawn, but scenario has no cargo")
        document["cargo"] |= {"initial_mass": mass, "final_mass": mass}
    return Scenario.model_validate(document | numbers)
