"""Creation of Inspect's tasks, and the registered tasks."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from multiprocessing import current_process
from typing import Final, TypedDict, Unpack

from inspect_ai import Task, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.scorer import Scorer
from inspect_ai.solver import Solver

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import DEFAULT_STEPS
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
TASK_NAMES: Final = tuple(builtin_tasks())
"""Names of all tasks."""
SOLVERS: Final[Mapping[str, Callable[[], Solver]]] = {"react": react_builder, "roles": five_roles}
"""Solvers by their names in the task argument `solver`."""


class TaskArguments(TypedDict, total=False):
    """Arguments of every task.

    Attributes:
        simulator: Name of the engine, `pybullet` or `mujoco`.
        rounds: Maximum number of submissions; a successful trial ends the building.
        rewards: Weights of rewards by name, or JSON of them, for the scorer `reward`.
        solver: `react`, Inspect's agent, or `roles`, BuildArena's workflow of five roles.
        seed: Seed of the start of machine and cargo; by default the exact start, as in the service.
        steps: Maximum number of calls.
    """

    simulator: str
    rounds: int
    rewards: dict[str, float] | str | None
    solver: str
    seed: int | None
    steps: int


def task_of(*tasks: str, **arguments: Unpack[TaskArguments]) -> Task:
    """Return a task of Inspect.

    Args:
        tasks: Names of BuildArena's tasks, each a sample.
        arguments: Settings of the samples.

    Raises:
        ChoiceError: An argument or its value is unknown.
        UnguardedProgramError: A process of a trial runs its parent's program again.
    """
    _require_guard()
    _require_known(arguments)
    solver = arguments.get("solver", "react")
    if solver not in SOLVERS:
        raise ChoiceError(f"unknown solver {solver!r}; valid solvers: {', '.join(SOLVERS)}")
    simulator = arguments.get("simulator", DEFAULT_ENGINE)
    rewards = arguments.get("rewards")
    if isinstance(rewards, str):
        rewards = _weights(rewards)
    samples = [
        _sample(
            Conditions(
                task=name,
                simulator=simulator,
                seed=arguments.get("seed"),
                rounds=arguments.get("rounds", 1),
                steps=arguments.get("steps", DEFAULT_STEPS),
                rewards=rewards,
            )
        )
        for name in tasks
    ]
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
    valid = TaskArguments.__annotations__
    for name in arguments.keys() - valid.keys():
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

    def make(**arguments: Unpack[TaskArguments]) -> Task:
        return task_of(*tasks, **arguments)

    make.__name__ = make.__qualname__ = name
    make.__module__ = f"{NAMESPACE}/{name}"  # no module can have a slash in its name
    make.__doc__ = builtin_tasks()[tasks[0]].title if len(tasks) == 1 else "All, each a sample."
    return task(name=f"{NAMESPACE}/{name}")(make)


TASKS: Final[Mapping[str, Callable[..., Task]]] = {
    name.replace("-", "_"): _register(name.replace("-", "_"), [name]) for name in TASK_NAMES
} | {"all": _register("all", TASK_NAMES)}
"""Tasks by the names that follow `buildarena/`."""
