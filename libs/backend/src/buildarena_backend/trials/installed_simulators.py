"""The simulators that are installed here: distributions register them as entry points.

An entry point of the group `buildarena.simulators` names a function that takes the entry point's
name and returns an `InstalledSimulator`. Nothing else lists simulators: workers, the command line
and the supervisor ask here, the API asks the workers (`known`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Final

from buildarena_backend.errors import StartupError
from buildarena_backend.settings import Settings
from buildarena_backend.trials.simulator import Simulator, SimulatorKind
from buildarena_simulation import DEFAULT_ENGINE

GROUP: Final = "buildarena.simulators"


@dataclass(frozen=True, slots=True, kw_only=True)
class InstalledSimulator:
    """A simulator as its distribution describes it; to describe it loads little.

    Attributes:
        name: The name that jobs give it.
        kind: Whether it is an engine, which calculates, or a game, which is played.
        make: Makes it. Raises `StartupError` where this machine is not set up for it.
        make_isolated: Makes it in a separate process, for runners, which a crash must not end;
            None where `make` does so.
        version: Its version here, as tracks name it; None where it is not set up.
        examine: Returns findings and remedies; "" where it can run.
        available: Whether what it needs is installed; without it, it counts as not there.
        single: Whether a machine runs one trial at a time, and one worker.
        deterministic: Whether the same input gives the same bytes.
    """

    name: str
    kind: SimulatorKind
    make: Callable[[Settings], Simulator]
    make_isolated: Callable[[Settings], Simulator] | None = None
    version: Callable[[Settings], str | None]
    examine: Callable[[Settings], tuple[str, str]]
    available: bool = True
    single: bool = False
    deterministic: bool = True


def installed_simulators() -> dict[str, InstalledSimulator]:
    """Return all that can run here, by name: the default engine, other engines, games.

    Raises:
        StartupError: One can't be loaded, or two have the same name.
    """
    simulators: dict[str, InstalledSimulator] = {}
    for point in entry_points(group=GROUP):
        if point.name in simulators:
            raise StartupError(f"two distributions register a simulator {point.name!r}")
        try:
            described = point.load()(point.name)
        except Exception as error:
            raise StartupError(
                f"the simulator {point.name!r} ({point.value}) can't be loaded: {error}"
            ) from error
        if described.available:
            simulators[point.name] = described
    ordered = sorted(simulators.values(), key=lambda s: (s.kind, s.name != DEFAULT_ENGINE, s.name))
    return {simulator.name: simulator for simulator in ordered}


def installed_engines() -> tuple[str, ...]:
    """Return the names of the engines that are installed; errors as in `installed_simulators`."""
    return tuple(s.name for s in installed_simulators().values() if s.kind == "engine")


def announced(simulator: InstalledSimulator) -> dict[str, str | bool]:
    """Return a worker's announcement of its simulator, from which a service accepts jobs."""
    return {"kind": simulator.kind, "deterministic": simulator.deterministic}
