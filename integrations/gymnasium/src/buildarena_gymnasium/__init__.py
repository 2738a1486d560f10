"""BuildArena's tasks as environments of Gymnasium: importing this package registers them."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

import gymnasium

from buildarena_benchmark import builtin_tasks
from buildarena_gymnasium.build_env import BuildEnv
from buildarena_gymnasium.drive_env import DriveEnv, fixed_machines
from buildarena_gymnasium.spaces import ACTION_SPACE, OBSERVATION_SPACE

__all__ = [
    "ACTION_SPACE",
    "OBSERVATION_SPACE",
    "BuildEnv",
    "DriveEnv",
    "drive_ids",
    "ids",
    "register_all",
]
NAMESPACE = "BuildArena"
_BUILDS = "buildarena_gymnasium.build_env:BuildEnv"
_DRIVES = "buildarena_gymnasium.drive_env:DriveEnv"


def ids() -> tuple[str, ...]:
    """Return the ids of building environments, such as ``BuildArena/Support-1-v0``."""
    return tuple(_id(task) for task in builtin_tasks())


def drive_ids() -> tuple[str, ...]:
    """Return the ids of environments with fixed machines, such as ``BuildArena/Drive-Hover-3-v0``.

    ``BuildArena/Drive-v0`` selects one of them by its argument `task`.
    """
    return tuple(_id(f"drive-{task}") for task in fixed_machines())


def register_all() -> None:
    """Register the environments that are not registered yet."""
    # No max_episode_steps: Gymnasium's own limit would end an episode without a trial.
    for name, task in zip(ids(), builtin_tasks(), strict=True):
        _register(name, _BUILDS, task=task)
    for name, task in zip(drive_ids(), fixed_machines(), strict=True):
        _register(name, _DRIVES, task=task)
    _register(_id("drive"), _DRIVES)


def _register(name: str, entry_point: str, **arguments: str) -> None:
    if name not in gymnasium.registry:
        gymnasium.register(name, entry_point, kwargs=arguments)


def _id(name: str) -> str:
    return f"{NAMESPACE}/{'-'.join(map(str.capitalize, name.split('-')))}-v0"


register_all()
