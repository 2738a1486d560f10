"""Kinds of tasks: what sort of machine each asks for, in whichever category boards list it."""

from typing import Final

KINDS: Final = ("support", "transport", "lift", "mechanisms", "flight")


def kind_of(task: str) -> str:
    """The kind of a task, by its name: what stands before the level."""
    return task.rpartition("-")[0]
