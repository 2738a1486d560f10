"""Trials by number, whose trajectories are compared between processors.

`python -m benchmarks.simulation.processor_trials COUNT` runs the first trials and prints a line of
JSON for each, after one with the processor as manifests say it. Bridges under a load that grows
until they break are among them: breaking amplifies the last bit of a sum.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import chain, count, islice
from typing import Any

from buildarena_geometry import kernels  # noqa: F401 - before numpy

# isort: split

from support.machines import random_machines, random_workshop
from support.machines.expert_calls import calls_of
from support.machines.references import REFERENCES, load_machine

from buildarena_benchmark import builtin_tasks, score
from buildarena_geometry import Machine
from buildarena_pipeline.agents.workbench import bench_of
from buildarena_simulation import (
    ENGINES,
    MachineNotSimulable,
    processor,
    simulate,
    write_trajectory,
)


@dataclass(frozen=True, kw_only=True)
class ProcessorTrial:
    """One trial.

    Attributes:
        name: What the machine is: a reference, the expert's, or drawn by a seed.
        task: The task.
        engine: The engine.
    """

    name: str
    task: str
    engine: str


def trials() -> Iterator[ProcessorTrial]:
    """The trials in order, without end: machines that somebody designed, then drawn ones."""
    designed = (
        *((f"expert {task}", task) for task in builtin_tasks()),
        *((f"reference {name}", reference.task) for name, reference in REFERENCES.items()),
    )
    names = tuple(sorted({*random_machines.TASKS, *random_workshop.TASKS}))
    drawn = ((f"seed {seed}", task) for seed in count() for task in names)
    for number, (name, task) in enumerate(chain(designed, drawn)):
        yield ProcessorTrial(name=name, task=task, engine=tuple(ENGINES)[number % len(ENGINES)])


def run(trial: ProcessorTrial) -> dict[str, Any]:
    """Digest of the trajectory's bytes, and what is read from it."""
    machine, task = _machine(trial), builtin_tasks()[trial.task]
    try:
        trajectory = simulate(machine, task.scenario, trial.engine)
    except MachineNotSimulable as error:
        return {"digest": f"refused: {error}", "success": False, "indicator": 0.0, "breaks": 0}
    result = score(task, machine, trajectory)
    return {
        "digest": hashlib.sha256(write_trajectory(trajectory)).hexdigest(),
        "success": result.success,
        "indicator": result.indicator,
        "breaks": len(trajectory.breaks),
    }


def _machine(trial: ProcessorTrial) -> Machine:
    kind, _, name = trial.name.partition(" ")
    if kind == "reference":
        return load_machine(name)
    if kind == "seed":
        if trial.task in random_machines.TASKS:
            return random_machines.random_machine(trial.task, int(name))
        return random_workshop.random_workshop_machine(trial.task, int(name))
    bench = bench_of(builtin_tasks()[trial.task], data_sheets=False)
    for call in calls_of(trial.task):
        bench.call(call["machine"], call["tool"], call["arguments"])
    chosen = bench.result()
    assert chosen is not None, f"the expert's machine of {trial.task} has no blocks"
    return chosen[1]


def main() -> None:
    """Runs the trials."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    options = parser.parse_args()
    _say({"processor": dict(processor())})
    for trial in islice(trials(), options.count):
        _say({"trial": asdict(trial), **run(trial)})


def _say(line: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(line) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
