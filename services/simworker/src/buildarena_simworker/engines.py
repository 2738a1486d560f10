"""Our own physics as a simulator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from buildarena_pipeline.runtime.simulators.simulator import (
    MachineRefusedError,
    Simulated,
    SimulatorFaultError,
    Trial,
)
from buildarena_simulation import (
    SIMULATION_VERSION,
    MachineNotSimulable,
    SimulationError,
    engine_version,
    simulate,
)


class EngineSimulator:
    """Runs trials with PyBullet or MuJoCo.

    Args:
        name: The engine's name.
    """

    repeatable = True

    def __init__(self, name: str) -> None:
        self.name = name

    @property
    def versions(self) -> Mapping[str, Any]:
        """What can change a trajectory."""
        return {
            "simulation": SIMULATION_VERSION,
            "engine": self.name,
            "engine_version": engine_version(self.name),
        }

    def run(self, trial: Trial) -> Simulated:
        """Simulates the machine; see `Simulator`."""
        try:
            trajectory = simulate(
                trial.machine,
                trial.task.scenario,
                engine=self.name,
                controls=trial.controls,
                on_progress=lambda _: trial.require_held(),
            )
        except MachineNotSimulable as error:
            raise MachineRefusedError(str(error)) from error
        except SimulationError as error:
            raise SimulatorFaultError(str(error)) from error
        return Simulated(trajectory=trajectory, versions=self.versions)

    def close(self) -> None:
        """An engine holds nothing between trials."""
