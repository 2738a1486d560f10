"""Lift, level 1: thrust over weight."""

import math
from typing import Final, Literal

import numpy as np

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.measures.masses import mass_of
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import gravity_of
from buildarena_benchmark.scoring.scorer import Deciding, Metric, Score, Scorer, Verdict, rounded
from buildarena_simulation import Scenario
from buildarena_simulation.constants import GRAVITY

_WARM_UP_S = 1.0
_HEATED_SHARE = 0.5


class ThrustScoring(Document):
    """Thrust over weight.

    Attributes:
        min_ratio: Indicator that must be exceeded.
    """

    name: Literal["thrust"]
    min_ratio: Threshold = 1.0


def judge(scoring: ThrustScoring, run: Run) -> Verdict:
    """Measure the net thrust's length over the weight.

    Source: the paper, section "Evaluation", with thrusts added as vectors.
    """
    count = len(run.time_s)
    ratio, metrics = thrust_to_weight(run, count)
    return Verdict(
        success=ratio > scoring.min_ratio,
        indicator=rounded(ratio),
        metrics=metrics,
        deciding=Deciding(samples=count, members=run.joined, cargo=False),
    )


def thrust_to_weight(run: Run, samples: int) -> tuple[float, dict[str, Metric]]:
    """Return net thrust over weight, and how many of its cannons are heated and cold.

    The thrusts are added as vectors, in the machine as it was built: cannons that push against
    each other cancel. A cannon counts if it stays joined to the starting block; the weight is that
    of everything joined to it at the start, so that nothing is gained by parts that come off. A
    cannon counts as heated if a flame touches it for half the trial, its first second aside.

    Args:
        samples: Number of samples for which a cannon must stay joined.
    """
    settled = run.trajectory.heated[run.time_s >= _WARM_UP_S]
    share = settled.mean(axis=0) if len(settled) else np.zeros(len(run.trajectory.cannon_ids))
    stays = dict(
        zip(run.trajectory.block_ids, np.atleast_1d(run.joined[:samples].all(axis=0)), strict=True)
    )
    pushes, heated = [], 0
    for block_id, hot in zip(run.trajectory.cannon_ids, share >= _HEATED_SHARE, strict=True):
        block = run.machine.blocks[block_id]
        thrust, spray = block.module.thrust, block.pointing_xyz
        if thrust is None or spray is None or not stays.get(block_id, True):
            continue
        heated += int(hot)
        size = thrust.heated if hot else thrust.cold
        pushes.append([-size * component for component in spray])
    # Exact sums: they do not depend on the cannons' order.
    net = [math.fsum(component) for component in zip(*pushes, strict=True)]
    mass = mass_of(run, run.joined[0])
    weight = mass * (gravity_of(run.trajectory) / GRAVITY)
    ratio = math.hypot(*net) / weight if weight > 0 else 0.0
    return ratio, {"heated_cannons": heated, "cold_cannons": len(pushes) - heated}


def explain(scoring: ThrustScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    count = score.metrics.get("heated_cannons")
    if not count:
        return "No heated cannon pushed."
    return (
        f"{count} heated cannon{'s' * (count > 1)} pushed {score.indicator:.2f} times the weight; "
        f"{scoring.min_ratio:g} is asked."
    )


SCORER: Final = Scorer(
    parameters=ThrustScoring,
    judge=judge,
    explain=explain,
    needs="places",
)
