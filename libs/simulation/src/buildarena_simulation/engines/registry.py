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
    """What the registry wants of an engine's module."""

    def create(self, world: "World") -> "Engine":
        """An engine with a world in it, without the machine's bodies yet."""

    def version(self) -> str:
        """Version of the engine's library."""


@cache
def all_engines() -> Mapping[str, str]:
    """The module of each engine by the engine's name, installed or not; the default one first."""
    folders = [part.name for part in pkgutil.iter_modules(engines.__path__) if part.ispkg]
    ours = {name: f"{engines.__name__}.{name}.engine" for name in folders if name != "shared"}
    others = {point.name: point.value for point in metadata.entry_points(group=GROUP)}
    names = sorted({*ours, *others}, key=lambda name: (name != DEFAULT_ENGINE, name))
    return MappingProxyType({name: (others | ours)[name] for name in names})


@cache
def known_engines() -> Mapping[str, str]:
    """Those whose library is installed.

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
    """An engine with a world in it, without the machine's bodies yet.

    Args:
        name: One of `known_engines`.
        world: What it shall hold.

    Raises:
        UnknownEngineError: No engine has this name.
        SimulationError: The engine's library cannot be loaded.
    """
    return _load(name).create(world)


def engine_version(name: str) -> str:
    """Version of an engine's library; errors as in `create_engine`."""
    return _load(name).version()


def _load(name: str) -> EngineModule:
    known = known_engines()
    if name not in known:
        choices = ", ".join(known)
        raise UnknownEngineError(f"no engine {name!r} is installed; there are {choices}")
    try:
        return cast("EngineModule", import_module(known[name]))
    except ImportError as error:
        raise SimulationError(f"the engine {name} cannot be loaded: {error}") from error


ENGINES: Final = tuple(known_engines())
"""Names of the engines that are installed."""
ALL_ENGINES: Final = tuple(all_engines())
"""Names of all engines, also of those that are not installed here."""
