"""One trial of a genome: what it is worth to the search, and what kind of machine it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from scenarios.hunt.evidence import Evidence, counts
from scenarios.hunt.suspicion import suspicions
from scenarios.hunt.variation.genome import Genome, grown

from buildarena_benchmark import Score, Task, broken_constraint, builtin_tasks, score
from buildarena_benchmark.tasks.loading import references
from buildarena_geometry import Machine
from buildarena_simulation import MachineNotSimulable, SimulationError, Trajectory, simulate

Scorer = Callable[[Task, Machine, Trajectory], Score]

RANGES: Final = ((1.0, 8.0), (0.0, 1.0), (0.0, 1.0))
CELLS: Final = (14, 8, 4)

_SEARCH_S: Final[Mapping[str, float]] = MappingProxyType(
    {
        "transport": 12.0,
        "thrust": 4.0,
        "height": 13.0,
        "road": 15.0,
        "slalom": 15.0,
        "hover": 15.0,
        "tour": 12.0,
        "heights": 24.0,
        "haul": 8.0,
    }
)
"""Seconds of a trial while searching, by scorer, where the whole trial is not needed."""

_WORLD: Final = 1
"""The drawn world in which machines with programs are searched."""

_FIRST_LOOK_S: Final = 4.0
"""A bridge that has carried nothing for two seconds by then never will."""

_ON_GROUND: Final = 0.15
"""A wheel whose rim is so near to the ground is on it, units."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A genome, tried.

    Attributes:
        genome: What was tried, without refused actions.
        objective: 0 and more for a success, by its indicator; below 0 for a failure, by how near it
            came.
        measures: Its place in the archive: parts as a power of two, oddness, share of parts that
            are not wood.
        success: Whether it succeeded and nothing disqualifies it.
        indicator: The score's.
        flags: The score's.
        parts: Number of parts.
        suspicions: Names of the checks that find it odd.
    """

    genome: Genome
    objective: float
    measures: tuple[float, float, float]
    success: bool
    indicator: float
    flags: tuple[str, ...]
    parts: int
    suspicions: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """JSON values for the archive."""
        return {**asdict(self), "key": self.genome.key, "genome": self.genome.as_json()}


def tried(task_name: str, genome: Genome, scorer: Scorer = score) -> Finding | None:
    """Tries a genome once on the faster engine."""
    task = builtin_tasks()[task_name]
    machine, genome = grown(genome)
    if broken_constraint(task, machine) is not None:
        return None
    try:
        result, trajectory = _searched(task, machine, scorer)
    except (MachineNotSimulable, SimulationError):
        return None
    success = counts(result)
    value = worth(task_name, result.indicator) if success else _nearness(task, result) - 1.0
    odd = suspicions(Evidence(task, machine, {"mujoco": (result, trajectory)})) if success else ()
    return Finding(
        genome=genome,
        objective=float(value),
        measures=_measures(task, machine, trajectory),
        success=success,
        indicator=result.indicator,
        flags=result.flags,
        parts=machine.part_count,
        suspicions=odd,
    )


def worth(task_name: str, indicator: float) -> float:
    """An indicator as a share of the expert's."""
    return indicator / references()[task_name]


def _searched(task: Task, machine: Machine, scorer: Scorer) -> tuple[Score, Trajectory]:
    whole, seed = task.scenario.duration_s, _WORLD if task.scenario.randomization else None
    lengths = [whole if seed else min(_SEARCH_S.get(task.scorer, whole), whole)]
    if task.scorer == "support":
        lengths.insert(0, _FIRST_LOOK_S)
    for length in lengths:
        scenario = task.scenario.model_copy(update={"duration_s": length})
        trajectory = simulate(machine, scenario, "mujoco", seed=seed)
        result = scorer(task, machine, trajectory)
        if not result.success:
            break
    return result, trajectory


def _nearness(task: Task, result: Score) -> float:
    """How near a failure came, 0 to 0.99: first to doing the thing at all, then to what counts."""

    def share(metric: str, whole: float) -> float:
        value = result.metrics.get(metric)
        return min(max(float(value or 0.0) / whole, 0.0), 1.0)

    if task.scorer == "support":
        evaded = 1.0 - share("floor_share", 1.0) if "does_not_span" in result.flags else 0.0
        return 0.5 * share("time_above_s", 2.0) + 0.49 * evaded
    if task.scorer == "transport":
        return 0.3 * share("displacement", 10.0) + 0.69 * min(result.indicator / 10.0, 1.0)
    if task.scorer == "height":
        return 0.6 * min(result.indicator / 30.0, 1.0) + 0.39 * share("thrust_to_weight", 1.0)
    return 0.99 * min(max(result.indicator, 0.0), 1.0)


def _measures(task: Task, machine: Machine, trajectory: Trajectory) -> tuple[float, float, float]:
    modules = [block.module for block in machine.blocks.values()]
    wood = sum(module.kind in {"start", "block"} for module in modules)
    oddness = {"support": _slenderness, "transport": _airborne}.get(task.category, _cancelled)
    return (
        float(np.log2(machine.part_count)),
        float(np.clip(oddness(machine, trajectory), 0.0, 1.0)),
        1.0 - wood / machine.part_count,
    )


def _slenderness(machine: Machine, trajectory: Trajectory) -> float:
    """Height over height and north-south length, as it starts: a tower is 1, a deck nearly 0."""
    del machine
    start = trajectory.positions[0].astype(np.float64)
    extent = start.max(axis=0) - start.min(axis=0) + 1.0
    return float(extent[2] / (extent[1] + extent[2]))


def _airborne(machine: Machine, trajectory: Trajectory) -> float:
    """Share of the time its wheels are off the ground; 1 without wheels."""
    rows = [i for i, b in enumerate(trajectory.block_ids) if machine.blocks[b].module.spins]
    heights = trajectory.positions[:, rows, 2].astype(np.float64)
    return float((heights > 1.0 + _ON_GROUND).mean()) if rows else 1.0


def _cancelled(machine: Machine, trajectory: Trajectory) -> float:
    """Share of the cannons' pushes that cancel; 1 without cannons."""
    del trajectory
    cannons = [block for block in machine.blocks.values() if block.module.kind == "cannon"]
    ways = [cannon.pointing_xyz for cannon in cannons if cannon.pointing_xyz is not None]
    if not ways:
        return 1.0
    return 1.0 - float(np.linalg.norm(np.sum(ways, axis=0))) / len(ways)
