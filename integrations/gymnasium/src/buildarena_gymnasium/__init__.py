"""BuildArena's tasks as environments of Gymnasium: importing this package registers them."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from buildarena_gymnasium.build_env import BuildEnv
from buildarena_gymnasium.drive_env import DriveEnv
from buildarena_gymnasium.registration import drive_ids, ids, register_all
from buildarena_gymnasium.spaces import ACTION_SPACE, OBSERVATION_SPACE

register_all()

__all__ = [
    "ACTION_SPACE",
    "OBSERVATION_SPACE",
    "BuildEnv",
    "DriveEnv",
    "drive_ids",
    "ids",
    "register_all",
]
