"""Tasks of Inspect: one for each of ours, and one with all of them as samples."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from multiprocessing import current_process
from typing import Any, Final

from inspect_ai import Task, task
from inspect_ai._util.registry import RegistryInfo, registry_add, registry_info
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.scorer import Scorer
from inspect_ai.solver import Solver

from buildarena_benchmark import builtin_tasks
from buildarena_environment import DEFAULT_STEPS
from buildarena_inspect.building import Conditions
from buildarena_inspect.errors import ChoiceError, UnguardedProgramError
from buildarena_inspect.log_artifacts import keep
from buildarena_inspect.roles import five_roles
from buildarena_inspect.scorers import indicator, reward, success
from buildarena_inspect.solvers import react_builder, workbench
from buildarena_simulation import DEFAULT_ENGINE

NAMESPACE: Final = "buildarena"
"""What comes before a task's name on Inspect's command line."""
SOLVERS: Final[Mapping[str, Callable[[], Solver]]] = {"react": react_builder, "roles": five_roles}
"""Solvers by the names that the task argument `solver` takes."""


def _made(tasks: Sequence[str], solver: str, **conditions: Any) -> Task:
    _require_guard()
    if solver not in SOLVERS:
        raise ChoiceError(f"there is no solver {solver!r}: choose from {', '.join(SOLVERS)}")
    rewards = conditions["rewards"]
    if isinstance(rewards, str):
        conditions["rewards"] = rewards = _weights(rewards)
    scorers: list[Scorer] = [success(), indicator(), *([reward()] if rewards else [])]
    return Task(
        dataset=MemoryDataset(
            [_sample(Conditions(task=name, **conditions)) for name in tasks], name=NAMESPACE
        ),
        setup=workbench(),
        solver=SOLVERS[solver](),
        scorer=scorers,
        cleanup=keep,
        # One that crashes the engine costs one sample, and `inspect eval-retry` takes it up.
        continue_on_fail=True,
        version=_version(tasks),
    )


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


def _version(tasks: Sequence[str]) -> str:
    """The version of our task; several have none together."""
    return builtin_tasks()[tasks[0]].version if len(tasks) == 1 else "0"


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
    """Registers a task under our name; Inspect's own way would put the module's before it."""

    def make(  # noqa: PLR0917 - Inspect gives them by name
        simulator: str = DEFAULT_ENGINE,
        rounds: int = 1,
        rewards: dict[str, float] | str | None = None,
        solver: str = "react",
        seed: int | None = None,
        steps: int = DEFAULT_STEPS,
    ) -> Task:
        return _made(
            tasks,
            solver,
            simulator=simulator,
            rounds=rounds,
            rewards=rewards,
            seed=seed,
            steps=steps,
        )

    make.__name__ = make.__qualname__ = name
    make.__doc__ = _documentation(tasks)
    made = task(make)
    metadata = registry_info(made).metadata
    registry_add(made, RegistryInfo(type="task", name=f"{NAMESPACE}/{name}", metadata=metadata))
    return made


def _documentation(tasks: Sequence[str]) -> str:
    title = builtin_tasks()[tasks[0]].title if len(tasks) == 1 else "All tasks, each a sample"
    return f"""{title}.

    Args:
        simulator: Name of the engine, `pybullet` or `mujoco`.
        rounds: How often a model may submit; a successful trial ends the building.
        rewards: Weights of rewards by name, for the scorer `reward`.
        solver: `react`, Inspect's agent, or `roles`, our workflow of five roles.
        seed: Varies where machine and cargo start; the exact start, the service's, without one.
        steps: Calls that a model may make.
    """


TASKS: Final[Mapping[str, Callable[..., Task]]] = {
    name.replace("-", "_"): _named(name.replace("-", "_"), [name]) for name in builtin_tasks()
} | {"all": _named("all", list(builtin_tasks()))}
"""Tasks by the names that follow `buildarena/`."""
