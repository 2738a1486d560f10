"""Designs of the built-in expert."""

# BuildArena benchmark data, not for training corpora:
# canary 3ab839c7-e533-462b-9729-71495c1ee1f6

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from buildarena_benchmark.experts.drafting import Action, Draft
from buildarena_benchmark.experts.programs import listed, program_text


@dataclass(frozen=True, slots=True, kw_only=True)
class PartDesign:
    """A sub-structure and the actions that build it.

    Attributes:
        description: Shape and size, for the plan.
        actions: Tool names and arguments, in order.
    """

    description: str
    actions: Sequence[Action]


@dataclass(frozen=True, slots=True, kw_only=True)
class PastTrial:
    """A past trial, as the controller sees it."""

    program: Mapping[str, Any]
    measured: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A complete machine.

    Attributes:
        parts: Sub-structures by name, in building order.
        assembly: Actions that put several sub-structures together.
        control: The controller's answer, for tasks that are driven.
        program: The controller's Lua program instead, for tasks that take programs.
        steer: Computes the key presses from the trials so far, where they depend on them.
    """

    overall: str
    parts: Mapping[str, PartDesign]
    assembly: Sequence[Action] = ()
    control: Mapping[str, Any] | None = None
    program: str = ""
    steer: Callable[[Sequence[PastTrial]], Mapping[str, Any]] | None = None


Designs = Mapping[str, Callable[[int], Design]]
"""By a task's name: the design for a seed, which varies it within its tolerances."""


def one_part(draft: Draft, name: str, description: str, *, overall: str, **control: Any) -> Design:
    """Return the design of a machine that is one sub-structure, as it was drafted.

    Args:
        control: Its control, program or steering; see `Design`.
    """
    part = PartDesign(description=description, actions=tuple(draft.actions))
    return Design(overall=overall, parts={name: part}, **control)


def sided_car(
    draft: Draft, sides: Mapping[str, Sequence[str]], package: str, program: str, **figures: str
) -> Design:
    """Return the design of a car whose wheels, left and right, a program of a package drives."""
    wheels = {name: listed(ids) for name, ids in sides.items()}
    return one_part(
        draft,
        "car",
        "A spine of 3 blocks, two cross members with two wheels each",
        overall="A car on four powered wheels that steers by driving its sides apart.",
        program=program_text(package, program, **wheels, **figures),
    )


def keyed(
    plan: str, bindings: Iterable[Sequence[str]], presses: Iterable[tuple[float, str, float]]
) -> Mapping[str, Any]:
    """Return a controller's answer.

    Args:
        bindings: Block, action, and its keys.
        presses: Time, key and duration, seconds.
    """
    return {
        "control_design": plan,
        "control_config": [
            {"block": block, "action": action, "keys": keys} for block, action, *keys in bindings
        ],
        "control_sequence": [
            {"time": time, "key": key, "hold_for": hold_for} for time, key, hold_for in presses
        ],
    }
