"""The mark that a task is about."""

from typing import Annotated

from pydantic import Field

from buildarena_simulation import Scenario
from buildarena_simulation.scenario import Mark

MarkName = Annotated[str, Field(min_length=1, max_length=40)]


def moving_mark(scenario: Scenario) -> str | None:
    """Return why a scorer of fixed places cannot judge: one of them moves; None if none does."""
    name = next((mark.name for mark in scenario.marks if mark.drift is not None), None)
    return None if name is None else f"mark {name!r} moves (drift), and this scorer's marks stay"


def unknown_mark(name: str, scenario: Scenario) -> str | None:
    """Return why no machine can reach a mark: the scenario lacks it; None if it has it."""
    names = [mark.name for mark in scenario.marks]
    if name in names:
        return None
    return f"unknown mark {name!r}; scenario.marks: {', '.join(names) or 'none'}"


def unusable_mark(name: str, scenario: Scenario) -> str | None:
    """Return why a scorer of fixed places cannot judge by a mark; None if it can."""
    return unknown_mark(name, scenario) or moving_mark(scenario)


def mark_of(name: str, scenario: Scenario) -> Mark:
    """Return a mark that there is."""
    return next(mark for mark in scenario.marks if mark.name == name)
