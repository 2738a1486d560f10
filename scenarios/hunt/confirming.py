"""Confirming what the search found: full length, both engines, and a few seeds."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from scenarios.hunt.evidence import Evidence, counts
from scenarios.hunt.suspicion import suspicions
from scenarios.hunt.variation.genome import Genome, grown
from threadpoolctl import threadpool_limits

from buildarena_benchmark import Score, Task, builtin_tasks, robustness, score
from buildarena_geometry import Machine
from buildarena_simulation import ENGINES, Trajectory, simulate
from buildarena_simulation.render.film import write_film

SEEDS: Final = (1, 2, 3, 4, 5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmed:
    """What full trials say of a genome.

    Attributes:
        task: Name of the task.
        genome: What builds it.
        document: The machine's document, which `buildarena machine simulate` takes.
        scores: Success, indicator and flags by engine.
        parts: Number of parts.
        robust_share: Share of the seeds it succeeded with.
        suspicions: Names of the checks that find it odd; none for what fails on both engines.
    """

    task: str
    genome: Genome
    document: Mapping[str, Any]
    scores: Mapping[str, Mapping[str, Any]]
    parts: int
    robust_share: float
    suspicions: tuple[str, ...]

    @property
    def success(self) -> bool:
        """Whether it succeeds on either engine and nothing disqualifies it there."""
        return any(found["success"] for found in self.scores.values())

    @property
    def indicator(self) -> float:
        """The lower engine's."""
        return min(float(found["indicator"]) for found in self.scores.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What a worker process is to confirm."""

    task: str
    genome: Genome
    picture: Path


def confirmed(order: Order) -> Confirmed:
    """Tries a machine at full length on both engines, and with a few seeds on the faster one."""
    task = builtin_tasks()[order.task]
    machine, genome = grown(order.genome)
    with threadpool_limits(limits=1):
        trials = {engine: _trial(task, machine, engine) for engine in reversed(ENGINES)}
        good = any(counts(result) for result, _ in trials.values())
        share = robustness(task, machine, "mujoco", SEEDS).share if good else 0.0
        write_film(machine, task.scenario, trials["mujoco"][1], order.picture)
    odd = suspicions(Evidence(task, machine, trials, share)) if good else ()
    return Confirmed(
        task=order.task,
        genome=genome,
        document=machine.to_document(),
        scores={engine: _told(result) for engine, (result, _) in trials.items()},
        parts=machine.part_count,
        robust_share=share,
        suspicions=odd,
    )


def _trial(task: Task, machine: Machine, engine: str) -> tuple[Score, Trajectory]:
    trajectory = simulate(machine, task.scenario, engine)
    return score(task, machine, trajectory), trajectory


def _told(result: Score) -> dict[str, Any]:
    return {
        "success": counts(result),
        "indicator": result.indicator,
        "flags": list(result.flags),
    }
