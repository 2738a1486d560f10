"""Our own physics as a simulator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from buildarena_backend.trials.simulator import (
    MachineRefusedError,
    SimulatorFaultError,
    TrialRequest,
    TrialResult,
)
from buildarena_benchmark.environment import TrialPool
from buildarena_benchmark.environment.trials.warm_process import ProcessEndedError
from buildarena_benchmark.scores import simulate_task
from buildarena_simulation import (
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
        machine, task = trial.machine, trial.task
        try:
            if self._pool is None:
                trajectory = simulate_task(
                    task,
                    machine,
                    self.name,
                    controls=trial.controls,
                    seed=trial.seed,
                    on_progress=lambda _: trial.require_held(),
                )
            else:
                trajectory = self._pool.simulate(
                    task,
                    machine,
                    self.name,
                    controls=trial.controls,
                    seed=trial.seed,
                    meanwhile=trial.require_held,
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
