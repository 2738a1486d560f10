"""The simulators that jobs can name: our engines, the game, and workers' announcements.

A service knows its simulators without having them: the engines' names come with the physics (where
a process has its own engines, only those count: others are missing on that machine), the game's
version from the settings, and any other simulator from the workers that bring it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Row

from buildarena_backend.process.context import Context
from buildarena_backend.settings import Settings
from buildarena_backend.states import simulate_queue
from buildarena_backend.trials.simulator import BESIEGE, SimulatorKind
from buildarena_benchmark import Task, ValidationIssue
from buildarena_simulation import (
    ALL_ENGINES,
    DEFAULT_ENGINE,
    ENGINES,
    SIMULATION_VERSION,
    UnknownEngineError,
    require_engine,
)

NO_GAME: Final = (
    "this service has no game to play: its operator names one by BUILDARENA_BESIEGE_GAME and "
    "BUILDARENA_BESIEGE_MOD, the versions of Besiege and of its Lua Scripting Mod"
)
"""Reason why a job for the game is refused."""
PREFIX: Final = simulate_queue("")
VERSION: Final = re.compile(r"[A-Za-z0-9._-]{1,80}")
"""Valid names and versions of simulators: tracks and queues have both in their names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorInfo:
    """Facts about a simulator that a service needs to accept jobs for it.

    Attributes:
        name: The name that jobs give it.
        version: The version in a track's name: only trials of one version are compared.
        kind: Whether it is an engine, which calculates, or a game, which is played.
        deterministic: Whether the same input gives the same bytes.
    """

    name: str
    version: str
    kind: SimulatorKind = "engine"
    deterministic: bool = True


def configured_simulators(settings: Settings) -> dict[str, SimulatorInfo]:
    """Return the simulators that a service takes jobs for even without a worker, by name."""
    engines = ENGINES or ALL_ENGINES
    infos = {name: SimulatorInfo(name=name, version=SIMULATION_VERSION) for name in engines}
    game = settings.besiege_version
    if game is not None:
        infos[BESIEGE] = SimulatorInfo(name=BESIEGE, version=game, kind="game", deterministic=False)
    for name, version in settings.extra_simulators.items():
        infos.setdefault(name, SimulatorInfo(name=name, version=version, deterministic=False))
    return infos


def known_simulators(context: Context) -> dict[str, SimulatorInfo]:
    """Return those, and the simulators of all workers that reported in the last hour, by name."""
    simulators = configured_simulators(context.settings)
    for announcement in context.store.workers.announcements():
        for name, simulator in announced_simulators(announcement).items():
            simulators.setdefault(name, simulator)
    return simulators


def find_simulator(context: Context, name: str) -> SimulatorInfo | None:
    """Return a simulator by its name; None if it is unknown."""
    configured = configured_simulators(context.settings).get(name)
    return configured or known_simulators(context).get(name)


def simulation_version(context: Context, name: str) -> str:
    """Return the version in a track's name.

    Raises:
        ValueError: The simulator is unknown.
    """
    simulator = find_simulator(context, name)
    if simulator is None:
        raise ValueError(_refusal(name))
    return simulator.version


def worlds_here(context: Context, name: str, asked: int | None) -> int:
    """Return the number of varied worlds in which machines are scored on a simulator.

    Args:
        asked: Requested number; None for the service's default, which is none where no seed repeats
            a trial.
    """
    if asked is not None:
        return asked
    simulator = find_simulator(context, name)
    return context.settings.worlds if simulator is not None and simulator.deterministic else 0


def worlds_issues(context: Context, name: str, asked: int | None) -> list[ValidationIssue]:
    """Return the problems of a requested number of worlds."""
    simulator = find_simulator(context, name)
    if not asked or simulator is None or simulator.deterministic:
        return []
    able = tuple(n for n, info in known_simulators(context).items() if info.deterministic)
    message = (
        f"{name} can't vary a world by a seed: leave `worlds` out, or take a simulator that can: "
        f"{', '.join(able)}"
    )
    return [ValidationIssue(path="worlds", message=message, choices=("0",))]


def sampling_issues(
    context: Context, name: str, asked: int | None, tasks: Mapping[str, Task]
) -> list[ValidationIssue]:
    """Return an issue for each task that needs sampled worlds where machines are tried in none.

    Args:
        asked: Requested number of worlds; None for the service's default.
        tasks: By their paths in what was submitted.
    """
    if worlds_here(context, name, asked):
        return []
    able = ", ".join(n for n, info in known_simulators(context).items() if info.deterministic)
    return [
        ValidationIssue(
            path=path,
            message=f"{task.name} is scored in worlds that differ: ask for `worlds` of 1 or more, "
            f"on a simulator that can vary them: {able}",
        )
        for path, task in tasks.items()
        if task.scenario.randomization
    ]


def simulator_issues(
    context: Context, *names: str, path: str = "simulator"
) -> list[ValidationIssue]:
    """Return an issue for each unknown simulator."""
    unknown = [name for name in names if find_simulator(context, name) is None]
    choices = tuple(known_simulators(context)) if unknown else ()
    return [ValidationIssue(path=path, message=_refusal(n), choices=choices) for n in unknown]


def announced_simulators(worker: Row[Any]) -> dict[str, SimulatorInfo]:
    """Return the simulators that a worker reports to run jobs for, by name."""
    version = worker.simulation
    if not isinstance(version, str) or not VERSION.fullmatch(version):
        return {}
    names = [queue.removeprefix(PREFIX) for queue in worker.queues if queue.startswith(PREFIX)]
    return {
        name: SimulatorInfo(
            name=name,
            version=version,
            kind="game" if worker.kind == "game" else "engine",
            deterministic=worker.deterministic is True,
        )
        for name in names
        if VERSION.fullmatch(name)
    }


def _refusal(name: str) -> str:
    if name == BESIEGE:
        return NO_GAME
    if name == DEFAULT_ENGINE:
        try:
            require_engine(name)
        except UnknownEngineError as error:
            return str(error)
    return f"unknown simulator {name!r}"
