"""An engine in a process of its own: one that crashes costs one trial, and is started again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from buildarena_benchmark.tasks.document import TaskDocument
from buildarena_benchmark.tasks.task import task_of
from buildarena_environment.warm_process import ProcessEndedError, WarmProcess
from buildarena_geometry import Machine
from buildarena_pipeline.runtime.simulators.simulator import (
    MachineRefusedError,
    Simulated,
    SimulatorFaultError,
    Trial,
)
from buildarena_simworker.engines import EngineSimulator


class EngineProcess:
    """A `Simulator` whose engine runs in another process, which stays warm between trials.

    Args:
        name: The engine's name.
    """

    repeatable = True

    def __init__(self, name: str) -> None:
        self.name = name
        self.versions: Mapping[str, Any] = EngineSimulator(name).versions
        self._process = WarmProcess(name, partial(_engine, name))

    def start(self) -> None:
        """Starts the process, so that the first trial finds it warm."""
        self._process.start()

    def run(self, trial: Trial) -> Simulated:
        """Simulates the machine; see `Simulator`."""
        # Documents: a task and a machine have parts that no pipe takes.
        question = (dict(trial.task.as_document()), trial.machine.to_document(), trial.controls)
        try:
            kind, found = self._process.ask(question, meanwhile=trial.require_held)
        except ProcessEndedError as error:
            raise SimulatorFaultError(f"{error} in the middle of a trial") from error
        if kind == "refused":
            raise MachineRefusedError(found)
        if kind == "fault":
            raise SimulatorFaultError(found)
        return Simulated(trajectory=found, versions=self.versions)

    def close(self) -> None:
        """Ends the process at once."""
        self._process.close()


def _engine(name: str) -> Callable[[Any], tuple[str, Any]]:
    return partial(_ran, EngineSimulator(name))


def _ran(simulator: EngineSimulator, question: Any) -> tuple[str, Any]:
    task, machine, controls = question
    trial = Trial(
        job_id="",
        number=0,
        token=0,
        version="",
        task=task_of(TaskDocument.model_validate(task)),
        machine=Machine.from_document(machine),
        controls=controls,
        require_held=lambda: None,
    )
    try:
        return "done", simulator.run(trial).trajectory
    except MachineRefusedError as error:
        return "refused", str(error)
    except SimulatorFaultError as error:
        return "fault", str(error)
