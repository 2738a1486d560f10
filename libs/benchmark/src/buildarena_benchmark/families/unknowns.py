"""Hidden parameters: numbers of the world that each job draws and its statement does not give.

The draw takes the place of the scenario's own figures, so whoever runs, scores or repeats a trial
needs to know nothing of it. Who builds must not be told what is drawn: see `docs/security.md`.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from buildarena_benchmark.fields import Document
from buildarena_simulation import Scenario
from buildarena_simulation.draws import between

Figure = Annotated[float, Field(gt=0, le=100_000, allow_inf_nan=False)]
Range = tuple[Figure, Figure]
"""Least and greatest; each number between is as likely."""


class Unknowns(Document):
    """The numbers of a scenario that are drawn, each from a range that the statement tells.

    Attributes:
        gravity: Of `Scenario.gravity`, units/s².
        cargo_mass: Of the cargo, which has it from the start to the end, mass units.
        drive_strength: Of `Scenario.drive_strength`.
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
                raise ValueError(f"{name} is from {bounds[0]:g} to {bounds[1]:g}: no range")
        return self

    def at_end(self, end: Literal[0, 1]) -> Self:
        """With ranges that have only their least number, or only their greatest."""
        ends = {name: getattr(self, name) for name in NAMES}
        return self.model_copy(
            update={name: (bounds[end], bounds[end]) for name, bounds in ends.items() if bounds}
        )


NAMES: Final = ("gravity", "cargo_mass", "drive_strength")


def drawn_numbers(unknowns: Unknowns, seed: int) -> dict[str, float]:
    """Return what a seed draws, by name; each name has a draw of its own."""
    numbers = {}
    for name in NAMES:
        bounds = getattr(unknowns, name)
        if bounds is not None:
            (numbers[name],) = between(name, bounds[:1], bounds[1:], seed)
    return numbers


def drawn_scenario(unknowns: Unknowns, scenario: Scenario, seed: int) -> Scenario:
    """Return the scenario with the numbers that a seed draws in place of its own.

    Raises:
        ValueError: A number is not one that a scenario may have, or there is no cargo for a mass.
    """
    numbers = drawn_numbers(unknowns, seed)
    document = scenario.model_dump(mode="json")
    mass = numbers.pop("cargo_mass", None)
    if mass is not None:
        if scenario.cargo is None:
            raise ValueError("cargo_mass is drawn, but scenario has no cargo")
        document["cargo"] |= {"initial_mass": mass, "final_mass": mass}
    return Scenario.model_validate(document | numbers)
