"""Whether trials with programs repeat, and how far the engines' senses are apart.

Run by `make bench-repeats`. The expert's machines fly and drive in drawn worlds on both engines,
each trial in two processes: every trajectory must have the same bytes in both. For the same machine
and world, the senses of the first second are compared between the engines: noise is drawn from the
seed alone, so what differs is physics.
"""

import argparse
import hashlib
from collections import defaultdict
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from benchmarks.figures import tell
from support.machines.piloted import experts_machine

from buildarena_benchmark import builtin_tasks
from buildarena_simulation import ENGINES, simulate, write_trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ

TRIALS: Final = 200
TASKS: Final = [name for name, task in builtin_tasks().items() if task.takes_programs]
QUANTILE: Final = 0.95


def trial(job: tuple[str, str, int]) -> dict[str, Any]:
    """A trial's digest, and what was sensed in its first second by name."""
    name, engine, seed = job
    task = builtin_tasks()[name]
    trajectory = simulate(experts_machine(task, seed % 5), task.scenario, engine, seed=seed)
    piloting = trajectory.piloting
    assert piloting is not None
    first = piloting.senses[:SAMPLE_RATE_HZ]
    return {
        "digest": hashlib.sha256(write_trajectory(trajectory)).hexdigest(),
        "senses": dict(zip(piloting.sense_names, first.T.tolist(), strict=True)),
    }


def kind_of(sense: str) -> str:
    """What a sense is about, without the block, the place and the axis."""
    *owner, last = sense.split(".")
    kind = owner[-1] if last in {"x", "y", "z"} else last
    return f"{owner[0]}: {kind}" if owner and owner[0] != kind else kind


def apart(one: Mapping[str, list[float]], other: Mapping[str, list[float]]) -> dict[str, float]:
    """By kind, how far the senses of two engines are apart at most."""
    most: dict[str, float] = defaultdict(float)
    for name, values in one.items():
        difference = float(np.abs(np.array(values) - np.array(other[name])).max())
        most[kind_of(name)] = max(most[kind_of(name)], difference)
    return dict(most)


def main() -> int:
    """Measures, prints and keeps.

    Returns:
        The exit code: 1 if a trial did not repeat.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--trials", type=int, default=TRIALS)
    options = parser.parse_args()
    seeds = range(-(-options.trials // (len(TASKS) * len(ENGINES))))
    jobs = [(name, engine, seed) for name in TASKS for engine in ENGINES for seed in seeds]
    with ProcessPoolExecutor(1) as first, ProcessPoolExecutor(1) as second:
        runs = [first.map(trial, jobs), second.map(trial, jobs)]
        one, two = (dict(zip(jobs, run, strict=True)) for run in runs)
    figures: dict[str, Any] = {
        "trials": len(jobs),
        "same_bytes": sum(one[job]["digest"] == two[job]["digest"] for job in jobs),
    }
    for name in TASKS:
        senses = partial(_senses, one, name)
        differences = [apart(*(senses(engine, seed) for engine in ENGINES)) for seed in seeds]
        kinds = sorted({kind for each in differences for kind in each})
        figures[name] = {
            kind: {
                "95 %": round(
                    float(np.quantile([each[kind] for each in differences], QUANTILE)), 4
                ),
                "most": round(max(each[kind] for each in differences), 4),
            }
            for kind in kinds
        }
    tell(figures, options.json)
    return 0 if figures["same_bytes"] == len(jobs) else 1


def _senses(
    trials: Mapping[tuple[str, str, int], dict[str, Any]], name: str, engine: str, seed: int
) -> dict[str, list[float]]:
    senses: dict[str, list[float]] = trials[name, engine, seed]["senses"]
    return senses


if __name__ == "__main__":
    raise SystemExit(main())
