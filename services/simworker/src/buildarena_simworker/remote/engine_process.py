"""An engine in a process of its own: one that crashes costs one trial, and is started again."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Mapping
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Final

from buildarena_benchmark.tasks.document import TaskDocument
from buildarena_benchmark.tasks.task import task_of
from buildarena_geometry import Machine
from buildarena_pipeline.runtime.processes import end_with_parent
from buildarena_simworker.simulators.engines import EngineSimulator
from buildarena_simworker.simulators.simulator import (
    MachineRefusedError,
    Simulated,
    SimulatorFaultError,
    Trial,
)

LOOK_EVERY_S: Final = 0.1
"""How soon after a lease is lost its trial is broken off."""
LONGEST_END_S: Final = 2.0


class EngineProcess:
    """A `Simulator` whose engine runs in another process, which stays warm between trials.

    Args:
        name: The engine's name.
    """

    repeatable = True

    def __init__(self, name: str) -> None:
        self.name = name
        self.versions: Mapping[str, Any] = EngineSimulator(name).versions
        # Forking a process that has threads is not safe, and impossible on Windows.
        self._processes = multiprocessing.get_context("spawn")
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None

    def start(self) -> None:
        """Starts the process, unless it runs."""
        if self._process is not None and self._process.is_alive():
            return
        self.close()
        self._pipe, theirs = self._processes.Pipe()
        self._process = self._processes.Process(
            target=_serve, args=(theirs, self.name, os.getpid()), name=self.name, daemon=True
        )
        self._process.start()
        theirs.close()

    def run(self, trial: Trial) -> Simulated:
        """Simulates the machine; see `Simulator`."""
        self.start()
        assert self._pipe is not None  # noqa: S101 - it was started
        try:
            self._pipe.send(
                {
                    "task": dict(trial.task.as_document()),
                    "machine": trial.machine.to_document(),
                    "controls": trial.controls,
                }
            )
            while not self._pipe.poll(LOOK_EVERY_S):
                trial.require_held()
            kind, found = self._pipe.recv()
        except (EOFError, OSError) as error:
            code = self._ended()
            raise SimulatorFaultError(
                f"the process of {self.name} ended with code {code} in the middle of a trial"
            ) from error
        except BaseException:
            self.close()  # it is still at a trial that nobody waits for
            raise
        if kind == "refused":
            raise MachineRefusedError(found)
        if kind == "fault":
            raise SimulatorFaultError(found)
        return Simulated(trajectory=found, versions=self.versions)

    def close(self) -> None:
        """Ends the process at once."""
        if self._process is not None:
            self._process.kill()
        self._ended()

    def _ended(self) -> int | None:
        process, self._process = self._process, None
        pipe, self._pipe = self._pipe, None
        if pipe is not None:
            pipe.close()
        if process is None:
            return None
        process.join(LONGEST_END_S)
        code = process.exitcode
        if code is not None:
            process.close()
        return code


def _serve(pipe: Connection, name: str, parent: int) -> None:
    """Runs trials until the pipe is closed."""
    end_with_parent(parent)
    # Whoever presses Ctrl-C means the parent, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    simulator = EngineSimulator(name)
    while True:
        try:
            given = pipe.recv()
        except (EOFError, OSError):
            return
        pipe.send(_ran(simulator, given))


def _ran(simulator: EngineSimulator, given: Mapping[str, Any]) -> tuple[str, Any]:
    trial = Trial(
        job_id="",
        number=0,
        token=0,
        version="",
        task=task_of(TaskDocument.model_validate(given["task"])),
        machine=Machine.from_document(given["machine"]),
        controls=given["controls"],
        require_held=lambda: None,
    )
    try:
        return "done", simulator.run(trial).trajectory
    except MachineRefusedError as error:
        return "refused", str(error)
    except SimulatorFaultError as error:
        return "fault", str(error)
