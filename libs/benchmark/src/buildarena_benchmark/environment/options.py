"""Choices of an environment by name: tasks, simulators, reference indicators."""

from typing import Final

from buildarena_benchmark import Task, builtin_tasks, references
from buildarena_benchmark.environment.errors import UnknownChoiceError
from buildarena_simulation import DEFAULT_ENGINE, ENGINES, require_engine

WITHOUT: Final = 1.0
"""The reference of a task that has none, where no reward asks for it."""


def resolve_task(task: Task | str) -> Task:
    """Return the task, or the built-in one of this name; underscores count as dashes.

    Raises:
        UnknownChoiceError: There is none.
    """
    if isinstance(task, Task):
        return task
    builtin = builtin_tasks().get(task.replace("_", "-"))
    if builtin is None:
        raise UnknownChoiceError("task", task, builtin_tasks())
    return builtin


def checked_simulator(name: str) -> str:
    """Return the name, if an engine of ours has it.

    Raises:
        UnknownChoiceError: None has.
        UnknownEngineError: It is the default one, and not installed.
    """
    if name not in ENGINES and name != DEFAULT_ENGINE:
        raise UnknownChoiceError("simulator", name, ENGINES)
    return require_engine(name)


def is_builtin(task: Task) -> bool:
    """Return whether it is a built-in task, whatever its seed."""
    builtin = builtin_tasks().get(task.name)
    return builtin is not None and builtin.with_seed(0) == task.with_seed(0)


def reference_of(task: Task, override: float | None = None, *, needed: bool = False) -> float:
    """Return the indicator that is worth 1.

    Args:
        needed: Whether a task without a reference is refused.

    Raises:
        ValueError: It is not above 0, or the task has none and one is needed.
    """
    if override is not None:
        if not override > 0:
            raise ValueError(f"reference is {override}: it must be above 0")
        return override
    reference = references().get(task.name)
    if reference is not None and is_builtin(task):
        return reference
    if needed:
        raise ValueError(
            f"{task.name} has no reference indicator: give one, or leave the reward 'indicator' out"
        )
    return WITHOUT
