"""The engines by name: each folder here with a module `engine`, and other distributions'.

Such a module has `create`, which makes an `Engine` of a `World`, and `version`, the version of its
library; the folder's `LIBRARY` names what must be installed. A distribution adds an engine by an
entry point in the group `buildarena.engines`, which names such a module.
"""

import pkgutil
from collections.abc import Mapping
from functools import cache
from importlib import import_module, metadata
from importlib.util import find_spec
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Protocol, cast

from buildarena_simulation import engines
from buildarena_simulation.constants import DEFAULT_ENGINE
from buildarena_simulation.errors import SimulationError, UnknownEngineError

if TYPE_CHECKING:
    from buildarena_simulation.engines.base import Engine, World

GROUP: Final = "buildarena.engines"


class EngineModule(Protocol):
    """Interface of an engine's module."""

    def create(self, world: "World") -> "Engine":
        """Create an engine with a world in it, without the machine's bodies."""

    def version(self) -> str:
        """Return the version of the engine's library."""


@cache
def all_engines() -> Mapping[str, str]:
    """Return the module of each engine by name, installed or not; the default one first."""
    folders = [part.name for part in pkgutil.iter_modules(engines.__path__) if part.ispkg]
    ours = {name: f"{engines.__name__}.{name}.engine" for name in folders if name != "shared"}
    plugins = {point.name: point.value for point in metadata.entry_points(group=GROUP)}
    names = sorted({*ours, *plugins}, key=lambda name: (name != DEFAULT_ENGINE, name))
    return MappingProxyType({name: (plugins | ours)[name] for name in names})


@cache
def known_engines() -> Mapping[str, str]:
    """Return the engines whose libraries are installed, with their modules.

    PyBullet has wheels for few systems and is missing where it can't be compiled; MuJoCo is always
    there, except in the image of the API, which simulates nothing.
    """
    return MappingProxyType({n: module for n, module in all_engines().items() if _can_run(module)})


def _can_run(module: str) -> bool:
    folder, _, _ = module.rpartition(".")
    if not folder.startswith(f"{engines.__name__}."):
        return True
    return find_spec(import_module(folder).LIBRARY) is not None


def create_engine(name: str, world: "World") -> "Engine":
    """Create an engine with a world in it, without the machine's bodies.

    Args:
        name: Name from `known_engines`.

    Raises:
        UnknownEngineError: The engine is unknown.
        SimulationError: The engine's library cannot be loaded.
    """
    return _load(name).create(world)


def engine_version(name: str) -> str:
    """Return the version of an engine's library; errors as in `create_engine`."""
    return _load(name).version()


def _load(name: str) -> EngineModule:
    installed = known_engines()
    if name not in installed:
        choices = ", ".join(installed)
        raise UnknownEngineError(f"no engine {name!r} is installed; there are {choices}")
    try:
        return cast("EngineModule", import_module(installed[name]))
    except ImportError as error:
        raise SimulationError(f"the engine {name} cannot be loaded: {error}") from error


ENGINES: Final = tuple(known_engines())
"""Names of the engines that are installed."""
ALL_ENGINES: Final = tuple(all_engines())
"""Names of all engines, including those that are not installed."""
