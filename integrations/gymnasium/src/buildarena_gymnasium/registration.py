"""Names of the environments in Gymnasium's registry."""

from __future__ import annotations

import gymnasium

from buildarena_benchmark import builtin_tasks

NAMESPACE = "BuildArena"


def ids() -> tuple[str, ...]:
    """Ids of all environments, such as ``BuildArena/Support-1-v0``, in the order of the tasks."""
    return tuple(_id(task) for task in builtin_tasks())


def register_all() -> None:
    """Registers those that are not yet."""
    for task in builtin_tasks():
        if _id(task) not in gymnasium.registry:
            # No max_episode_steps: Gymnasium's own limit would end an episode without a trial.
            gymnasium.register(
                _id(task), "buildarena_gymnasium.build_env:BuildEnv", kwargs={"task": task}
            )


def _id(task: str) -> str:
    return f"{NAMESPACE}/{task.capitalize()}-v0"
