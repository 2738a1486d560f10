"""A trial as it was run on another kind of processor: in a process with that one's kernels.

``python -m buildarena_benchmark.environment.other_kernels`` reads what to simulate from its
standard input and writes the trajectory as Parquet.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Final

from buildarena_benchmark.environment.trials.processes import PARENT, end_with_parent
from buildarena_benchmark.scores import simulate_task
from buildarena_benchmark.tasks.document import TaskDocument
from buildarena_benchmark.tasks.task import Task, task_of
from buildarena_geometry import KeyPress, Machine, kernels
from buildarena_simulation import (
    MachineNotSimulable,
    SimulationError,
    Trajectory,
    read_trajectory,
    require_engine,
    write_trajectory,
)

LONGEST_S: Final = 600.0
REFUSED: Final = 3
"""The process' exit code where the engine can't take the machine."""


def simulate_with(
    name: str,
    task: Task,
    machine: Machine,
    engine: str,
    *,
    controls: Sequence[KeyPress] | None = None,
    seed: int | None = None,
) -> Trajectory:
    """Simulate like `simulate_task`, with the kernels that OpenBLAS calls by this name.

    Raises:
        UnknownEngineError: No engine of this name is installed.
        MachineNotSimulable: The engine can't take the machine.
        SimulationError: The processor lacks them, or the trial failed; never scored.
    """
    require_engine(engine)
    if name not in kernels.runnable():
        raise SimulationError(f"this processor has no kernels {name}")
    question = {
        "machine": machine.to_document(),
        "task": task.as_document(),
        "engine": engine,
        "controls": None if controls is None else [asdict(press) for press in controls],
        "seed": seed,
    }
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__],
            input=json.dumps(question).encode(),
            env={**os.environ, kernels.CHOICE: name, PARENT: str(os.getpid())},
            capture_output=True,
            timeout=LONGEST_S,
            check=True,
        )
    except subprocess.TimeoutExpired as error:
        raise SimulationError(f"the trial took longer than {LONGEST_S:g} s") from error
    except subprocess.CalledProcessError as error:
        if error.returncode == REFUSED:
            raise MachineNotSimulable(error.stdout.decode("utf-8")) from error
        lines = error.stderr.decode("utf-8", "replace").strip().splitlines()
        raise SimulationError(f"with kernels {name}: {lines[-1] if lines else error}") from error
    return read_trajectory(done.stdout)


def main() -> None:
    """Simulate what the standard input describes."""
    end_with_parent()
    question = json.load(sys.stdin)
    controls = question["controls"]
    try:
        trajectory = simulate_task(
            task_of(TaskDocument.model_validate(question["task"])),
            Machine.from_document(question["machine"]),
            question["engine"],
            controls=None if controls is None else tuple(KeyPress(**press) for press in controls),
            seed=question["seed"],
        )
    except MachineNotSimulable as error:
        sys.stdout.write(str(error))
        sys.exit(REFUSED)
    sys.stdout.buffer.write(write_trajectory(trajectory))


if __name__ == "__main__":
    main()
