"""Our engines as simulators that are installed: what this distribution's entry points name."""

from __future__ import annotations

from buildarena_backend.trials.installed_simulators import InstalledSimulator
from buildarena_backend.trials.simulator import Simulator
from buildarena_benchmark.environment import TrialPool
from buildarena_simulation import ENGINES, SIMULATION_VERSION, engine_version
from buildarena_simworker.engines import EngineSimulator


def engine_simulator(name: str) -> InstalledSimulator:
    """Describe a built-in engine."""
    return InstalledSimulator(
        name=name,
        kind="engine",
        make=lambda _: EngineSimulator(name),
        make_isolated=lambda _: _isolated(name),
        version=lambda _: SIMULATION_VERSION,
        examine=lambda _: _examine(name),
        available=name in ENGINES,
    )


def _isolated(name: str) -> Simulator:
    pool = TrialPool(1, name=name)
    pool.start()
    return EngineSimulator(name, pool)


def _examine(name: str) -> tuple[str, str]:
    try:
        return f"{name} {engine_version(name)}", ""
    except Exception as error:  # noqa: BLE001 - whatever keeps it from being loaded
        return f"{name}: {error}", f"install {name}"
