"""The mark that a task is about."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from buildarena_simulation import Scenario

MarkName = Annotated[str, Field(min_length=1, max_length=40)]


def lacking_mark(name: str, scenario: Scenario) -> str | None:
    """Why no machine can reach a mark: there is none of this name; None if there is."""
    names = [mark.name for mark in scenario.marks]
    if name in names:
        return None
    return f"there is no mark {name!r} in scenario.marks: there are {', '.join(names) or 'none'}"


def center_of_mark(name: str, scenario: Scenario) -> NDArray[np.float64]:
    """The middle of a mark that there is, (3,), world frame, units."""
    return np.array(next(mark.center for mark in scenario.marks if mark.name == name))
