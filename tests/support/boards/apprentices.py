"""Models of known strength: they build as the expert does, and in some jobs forget steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final
from zlib import crc32

import numpy as np
from support.machines.expert_calls import calls_of

from buildarena_benchmark import Task
from buildarena_benchmark.leaderboard import EndedJob
from buildarena_environment import Environment, NothingToSubmitError
from buildarena_environment.trials import try_machine
from buildarena_geometry import Machine

APPRENTICES: Final[Mapping[str, int]] = MappingProxyType({"strong": 0, "middling": 2, "weak": 1})
"""By model: in every how manyth job it forgets steps; 0 for none."""
FORGOTTEN: Final = 8
"""How many steps are forgotten then, on average."""
_OUTCOMES: Final = ("unsuccessful", "success")


def job_of(task: Task, model: str, seed: int, *, worlds: Sequence[int], engine: str) -> EndedJob:
    """A model's job, as a service would score it.

    Args:
        task: One of the built-in tasks.
        model: One of `APPRENTICES`.
        seed: Of the job: what is forgotten, and how the expert varies its design.
        worlds: Seeds of the varied worlds.
        engine: What simulates.
    """
    environment = Environment(task, simulator=engine)
    forgotten = np.random.default_rng([seed, crc32(model.encode()), crc32(task.name.encode())])
    calls, every = calls_of(task.name, seed), APPRENTICES[model]
    share = FORGOTTEN / len(calls) if every and seed % every == 0 else 0.0
    for made in calls:
        if forgotten.random() >= share:
            # What hangs on a forgotten step is refused, as a model's own slips are.
            environment.step(made["tool"], made["arguments"], machine=made["machine"])
    try:
        machine = environment.submitted()
    except NothingToSubmitError:
        machine = Machine()
    exact = try_machine(task, machine, engine)
    # What breaks a rule is tried in no world.
    varied = [
        try_machine(task, machine, engine, seed=world) for world in worlds if exact.trajectory
    ]
    gained = [trial.score.indicator for trial in varied if trial.counts]
    return EndedJob(
        job_id=f"{task.name}/{model}/{seed}",
        task=task.name,
        task_version=task.version,
        model=model,
        configuration=model,
        seed=seed,
        outcome="construction_failed" if exact.reason else _OUTCOMES[exact.score.success],
        success=exact.score.success,
        indicator=exact.score.indicator,
        flags=exact.score.flags,
        robustness=len(gained) / len(varied) if varied else None,
        robust_indicator=sum(gained) / len(varied) if varied else None,
    )
