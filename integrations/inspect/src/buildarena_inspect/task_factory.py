"""Creation of Inspect's tasks, and the registered tasks.

Inspect's entry points name this module, whose imports register solvers, scorers and metrics.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from multiprocessing import current_process
from typing import Any, Final

from inspect_ai import Task, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.scorer import Scorer
from inspect_ai.solver import Solver

from buildarena_benchmark import builtin_tasks
from buildarena_inspect.building import Conditions
from buildarena_inspect.errors import ChoiceError, UnguardedProgramError
from buildarena_inspect.log_artifacts import keep
from buildarena_inspect.roles import five_roles
from buildarena_inspect.scorers import indicator, reward, success
from buildarena_inspect.solvers import react_builder, workbench
from buildarena_inspect.versions import inspect_version, task_metadata
from buildarena_simulation import DEFAULT_ENGINE

NAMESPACE: Final = "buildarena"
"""Prefix of a task's name on Inspect's command line."""
SOLVERS: Final[Mapping[str, Callable[[], Solver]]] = {"react": react_builder, "roles": five_roles}
"""Solvers by their names in the task argument `solver`."""


def task_of(*tasks: str, solver: str = "react", **arguments: Any) -> Task:
    """Return a task of Inspect.

    Args:
        tasks: Names of BuildArena's tasks, each a sample.
        solver: `react`, Inspect's agent, or `roles`, BuildArena's workflow of five roles.
        arguments: Conditions of the samples; rewards may be JSON.

    Raises:
        ChoiceError: An argument or its value is unknown.
        UnguardedProgramError: A process of a trial runs its parent's program again.
    """
    _require_guard()
    _require_known(arguments)
    if solver not in SOLVERS:
        raise ChoiceError(f"unknown solver {solver!r}; valid solvers: {', '.join(SOLVERS)}")
    if isinstance(arguments.get("rewards"), str):
        arguments["rewards"] = _weights(arguments["rewards"])
    samples = [_sample(Conditions(task=name, **arguments)) for name in tasks]
    rewards, simulator = arguments.get("rewards"), arguments.get("simulator", DEFAULT_ENGINE)
    scorers: list[Scorer] = [success(), indicator(), *([reward()] if rewards else [])]
    return Task(
        dataset=MemoryDataset(samples, name=NAMESPACE),
        setup=workbench(),
        solver=SOLVERS[solver](),
        scorer=scorers,
        cleanup=keep,
        # A crash of the engine costs one sample, which `inspect eval-retry` repeats.
        continue_on_fail=True,
        version=inspect_version(tasks),
        metadata=task_metadata(tasks, simulator),
    )


def _require_known(arguments: Mapping[str, object]) -> None:
    valid = ["solver", *(field.name for field in fields(Conditions) if field.name != "task")]
    for name in arguments.keys() - {*valid}:
        raise ChoiceError(f"unknown argument {name!r}; valid arguments: {', '.join(valid)}")


def _require_guard() -> None:
    """Check that this is not a process of a trial that runs its parent's program again."""
    if getattr(current_process(), "_inheriting", False):
        raise UnguardedProgramError(
            "trials start processes, which run a program's top level again: put evaluations "
            'under `if __name__ == "__main__":`'
        )


def _sample(conditions: Conditions) -> Sample:
    environment = conditions.environment()
    return Sample(
        id=conditions.task,
        input=environment.observation.briefing,
        target="success",
        metadata=conditions.as_metadata(),
    )


def _weights(text: str) -> dict[str, float]:
    """Return the weights of rewards in JSON of a command line."""
    try:
        weights = json.loads(text)
        return {str(name): float(weight) for name, weight in weights.items()}
    except (AttributeError, TypeError, ValueError) as error:
        raise ChoiceError(
            f"rewards {text!r} must be an object of weights by name, such as "
            '{"success": 1, "indicator": 0.5}'
        ) from error


def _register(name: str, tasks: Sequence[str]) -> Callable[..., Task]:
    """Register a task under the prefix `buildarena`.

    Inspect prefixes functions of installed modules with the package's name, which would be
    `buildarena_inspect`, but not functions without a module.
    """

    def make(**arguments: Any) -> Task:
        return task_of(*tasks, **arguments)

    make.__name__ = make.__qualname__ = name
    make.__module__ = f"{NAMESPACE}/{name}"  # no module can have a slash in its name
    make.__doc__ = builtin_tasks()[tasks[0]].title if len(tasks) == 1 else "All, each a sample."
    return task(name=f"{NAMESPACE}/{name}")(make)


TASKS: Final[Mapping[str, Callable[..., Task]]] = {
    name.replace("-", "_"): _register(name.replace("-", "_"), [name]) for name in builtin_tasks()
} | {"all": _register("all", tuple(builtin_tasks()))}
"""Tasks by the names that follow `buildarena/`."""
