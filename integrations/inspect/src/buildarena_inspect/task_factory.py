"""What every task of Inspect is made of, and the tasks under our name."""

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
"""What comes before a task's name on Inspect's command line."""
TASK_NAMES: Final = tuple(builtin_tasks())
"""Our names of all tasks."""
SOLVERS: Final[Mapping[str, Callable[[], Solver]]] = {"react": react_builder, "roles": five_roles}
"""Solvers by the names that the task argument `solver` takes."""


class TaskArguments(TypedDict, total=False):
    """What every task takes, each by its name.

    Attributes:
        simulator: Name of the engine, `pybullet` or `mujoco`.
        rounds: How often a model may submit; a successful trial ends the building.
        rewards: Weights of rewards by name, or JSON of them, for the scorer `reward`.
        solver: `react`, Inspect's agent, or `roles`, our workflow of five roles.
        seed: Varies where machine and cargo start; the exact start, the service's, without one.
        steps: Calls that a model may make.
    """

    simulator: str
    rounds: int
    rewards: dict[str, float] | str | None
    solver: str
    seed: int | None
    steps: int


def task_of(*tasks: str, **arguments: Unpack[TaskArguments]) -> Task:
    """A task of Inspect.

    Args:
        tasks: Names of our tasks, each a sample.
        arguments: What they are played under.

    Raises:
        ChoiceError: An argument or what it names does not exist.
        UnguardedProgramError: A program runs its top level again in the process of a trial.
    """
    _require_guard()
    _require_known(arguments)
    solver = arguments.get("solver", "react")
    if solver not in SOLVERS:
        raise ChoiceError(f"there is no solver {solver!r}: choose from {', '.join(SOLVERS)}")
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
        # One that crashes the engine costs one sample, and `inspect eval-retry` runs it again.
        continue_on_fail=True,
        version=inspect_version(tasks),
        metadata=task_metadata(tasks, simulator),
    )


def _require_known(arguments: Mapping[str, object]) -> None:
    known = TaskArguments.__annotations__
    for name in arguments.keys() - known.keys():
        raise ChoiceError(f"there is no argument {name!r}: choose from {', '.join(known)}")


def _require_guard() -> None:
    """Checks that this is no process of a trial which runs its parent's program again."""
    if getattr(current_process(), "_inheriting", False):
        raise UnguardedProgramError(
            "trials start processes, which run a program's top level again: put what evaluates "
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
    """Weights of rewards from a command line, as JSON."""
    try:
        found = json.loads(text)
        return {str(name): float(weight) for name, weight in found.items()}
    except (AttributeError, TypeError, ValueError) as error:
        raise ChoiceError(
            f"rewards is {text!r}: it is an object of weights by name, such as "
            '{"success": 1, "indicator": 0.5}'
        ) from error


def _named(name: str, tasks: Sequence[str]) -> Callable[..., Task]:
    """A task under our name.

    Inspect puts the package before the name of a function of an installed module, which would be
    `buildarena_inspect`. A function of no module keeps the name that it is given.
    """

    def make(**arguments: Unpack[TaskArguments]) -> Task:
        return task_of(*tasks, **arguments)

    make.__name__ = make.__qualname__ = name
    make.__module__ = f"{NAMESPACE}/{name}"  # no module can have a slash in its name
    make.__doc__ = builtin_tasks()[tasks[0]].title if len(tasks) == 1 else "All, each a sample."
    return task(name=f"{NAMESPACE}/{name}")(make)


TASKS: Final[Mapping[str, Callable[..., Task]]] = {
    name.replace("-", "_"): _named(name.replace("-", "_"), [name]) for name in TASK_NAMES
} | {"all": _named("all", TASK_NAMES)}
"""Tasks by the names that follow `buildarena/`."""
