"""Lift, level 1: thrust over weight."""

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from buildarena_benchmark.scorers.verdict import Metric, Verdict, rounded
from buildarena_benchmark.tasks.document import ThrustScoring

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

_WARM_UP_S = 1.0
_HEATED_SHARE = 0.5


def judge(scoring: ThrustScoring, machine: "Machine", trajectory: "Trajectory") -> Verdict:
    """The indicator is the thrust of all cannons, heated and cold, over the total mass.

    Args:
        scoring: Thresholds.
        machine: Gives the mass and the cannons' thrusts.
        trajectory: Gives the heated cannons.

    Source: the paper, section "Evaluation".
    """
    ratio, metrics = thrust_to_weight(machine, trajectory)
    return Verdict(success=ratio > scoring.min_ratio, indicator=rounded(ratio), metrics=metrics)


def thrust_to_weight(
    machine: "Machine", trajectory: "Trajectory"
) -> tuple[float, dict[str, Metric]]:
    """Thrust over weight, and how many cannons are heated and cold.

    A cannon counts as heated if a flame touches it for half the trial, its first second aside.
    """
    settled = trajectory.heated[trajectory.time_s >= _WARM_UP_S]
    share = settled.mean(axis=0) if len(settled) else np.zeros(len(trajectory.cannon_ids))
    is_heated = share >= _HEATED_SHARE
    heated = int(is_heated.sum())
    cannons = [machine.blocks[block].module.thrust for block in trajectory.cannon_ids]
    pushes = Counter(
        thrust.heated if hot else thrust.cold
        for thrust, hot in zip(cannons, is_heated, strict=True)
        if thrust is not None
    )
    # Counted first: products of equal pushes round alike, whatever the cannons' order.
    total = sum(push * count for push, count in sorted(pushes.items()))
    mass = float(machine.mass)
    ratio = total / mass if mass > 0 else 0.0
    return ratio, {"heated_cannons": heated, "cold_cannons": len(cannons) - heated}
