"""The engines behind one seam; each is imported only when a trial asks for it."""

import importlib
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Final

from buildarena_simulation.errors import SimulationError, UnknownEngineError

if TYPE_CHECKING:
    from buildarena_simulation.engines.base import Engine, World

_CLASSES: Final = {"pybullet": "PyBulletEngine", "mujoco": "MujocoEngine"}

ENGINES: Final = tuple(name for name in _CLASSES if name == "mujoco" or find_spec(name))
"""Names of the engines that are installed; the first is the default.

PyBullet has wheels for few systems and is missing where it can't be compiled; MuJoCo is always
there.
"""


def create_engine(name: str, world: "World") -> "Engine":
    """An engine with a world in it, without the machine's bodies yet.

    Args:
        name: One of `ENGINES`.
        world: What it shall hold.

    Raises:
        UnknownEngineError: No engine has this name.
        SimulationError: The engine's library cannot be loaded.
    """
    module = _load(name)
    engine: Engine = getattr(module, _CLASSES[name])(world)
    return engine


def engine_version(name: str) -> str:
    """Version of an engine's library; errors as in `create_engine`."""
    return str(_load(name).version())


def _load(name: str) -> ModuleType:
    if name not in ENGINES:
        raise UnknownEngineError(f"no engine {name!r} is installed; there are {', '.join(ENGINES)}")
    try:
        return importlib.import_module(f"buildarena_simulation.engines.{name}")
    except ImportError as error:
        raise SimulationError(f"the engine {name} cannot be loaded: {error}") from error
