"""Kinds of tasks: what sort of machine each asks for, in whichever category boards list it."""

from typing import Final

KINDS: Final = ("support", "transport", "lift", "mechanisms", "flight")

_FAMILIES: Final = {"budget": "support", "repair": "transport", "identify": "flight"}
"""What sort of machine a family asks for."""


def kind_of(task: str) -> str:
    """The kind of a task, by its name: what stands before the level, or what a family is of."""
    kind = task.rpartition("-")[0]
    return _FAMILIES.get(kind, kind)
