"""Lift, level 1: thrust over weight."""

from typing import TYPE_CHECKING

import numpy as np

from buildarena_benchmark.scorers.verdict import Metric, Verdict, rounded
from buildarena_benchmark.tasks.document import ThrustScoring
from buildarena_simulation.constants import COLD_THRUST, HEATED_THRUST

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

_WARM_UP_S = 1.0
_HEATED_SHARE = 0.5


def judge(scoring: ThrustScoring, machine: "Machine", trajectory: "Trajectory") -> Verdict:
    """The indicator is (13.76 x heated + 1.6 x cold cannons) / total mass.

    Args:
        scoring: Thresholds.
        machine: Gives the mass.
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
    heated = int((share >= _HEATED_SHARE).sum())
    cold = len(trajectory.cannon_ids) - heated
    mass = float(machine.mass)
    ratio = (HEATED_THRUST * heated + COLD_THRUST * cold) / mass if mass > 0 else 0.0
    return ratio, {"heated_cannons": heated, "cold_cannons": cold}
