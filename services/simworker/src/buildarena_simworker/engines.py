"""Our own physics as simulators: what this distribution's entry points name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from buildarena_backend.trials.installed_simulators import InstalledSimulator
from buildarena_backend.trials.simulator import MachineRefusedError, Simulator, SimulatorFaultError
from buildarena_backend.trials.trials import TrialRequest, TrialResult
from buildarena_benchmark.environment import TrialPool
from buildarena_benchmark.environment.trials.warm_process import ProcessEndedError
from buildarena_benchmark.scores import simulate_task
from buildarena_simulation import (
    ENGINES,
    SIMULATION_VERSION,
    MachineNotSimulable,
    SimulationError,
    engine_version,
    processor,
)


class EngineSimulator:
    """Runs trials with PyBullet or MuJoCo.

    Args:
        name: The engine's name.
        pool: The process to run them in, warm between trials: an engine that crashes there costs
            one trial. None for this process. It is closed with the simulator.
    """

    def __init__(self, name: str, pool: TrialPool | None = None) -> None:
        self.name = name
        self._pool = pool
        self.versions: Mapping[str, Any] = {
            "simulation": SIMULATION_VERSION,
            "engine": name,
            "engine_version": engine_version(name),
            "processor": dict(processor()),
        }

    def run(self, trial: TrialRequest) -> TrialResult:
        """Simulate the machine; see `Simulator`."""
        if self._pool is None:
            play = partial(simulate_task, on_progress=lambda _: trial.require_held())
        else:
            play = partial(self._pool.simulate, meanwhile=trial.require_held)
        try:
            trajectory = play(
                trial.task, trial.machine, self.name, controls=trial.controls, seed=trial.seed
            )
        except MachineNotSimulable as error:
            raise MachineRefusedError(str(error)) from error
        except SimulationError as error:
            raise SimulatorFaultError(str(error)) from error
        except ProcessEndedError as error:
            raise SimulatorFaultError(f"{error} in the middle of a trial") from error
        return TrialResult(trajectory=trajectory, versions=self.versions)

    def close(self) -> None:
        """End its process at once, if it has one; an engine holds nothing between trials."""
        if self._pool is not None:
            self._pool.close()


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
