"""BuildArena's tasks as environments of Gymnasium: importing this package registers them."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from buildarena_gymnasium.build_env import BuildEnv
from buildarena_gymnasium.registration import ids, register_all
from buildarena_gymnasium.spaces import ACTION_SPACE, OBSERVATION_SPACE

register_all()

__all__ = ["ACTION_SPACE", "OBSERVATION_SPACE", "BuildEnv", "ids", "register_all"]
