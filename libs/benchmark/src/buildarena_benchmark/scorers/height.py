"""Lift, levels 2 and 3: how high a rocket rises."""

from typing import TYPE_CHECKING

import numpy as np

from buildarena_benchmark.scorers.pieces import joined_to_start
from buildarena_benchmark.scorers.series import speeds, starting_block
from buildarena_benchmark.scorers.thrust import thrust_to_weight
from buildarena_benchmark.scorers.verdict import Deciding, Metric, Verdict, rounded
from buildarena_benchmark.tasks.document import HeightScoring

if TYPE_CHECKING:
    from buildarena_benchmark.tasks.task import Task
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory


def judge(task: "Task", machine: "Machine", trajectory: "Trajectory") -> Verdict:
    """The indicator is the greatest height of any block that is joined to the starting block.

    The trial succeeds if it exceeds a height and the rocket still rises: the mean height of its
    highest block must grow from one window of time to the next. What has come off counts for
    nothing.

    Args:
        task: Thresholds.
        machine: Gives the mass.
        trajectory: The trial.

    Flags:
        `twr_below_one`: success although the net thrust is less than the weight.

    Source: the paper, section "Evaluation"; thresholds as in the published evaluation.
    """
    scoring = task.scoring
    assert isinstance(scoring, HeightScoring)  # noqa: S101 - the scorer is chosen by it
    time_s = trajectory.time_s
    positions = trajectory.positions.astype(np.float64)
    joined = joined_to_start(machine, trajectory)
    highest = np.where(joined, positions[:, :, 2], -np.inf).max(axis=1)
    early, late = (
        highest[(time_s > start) & (time_s <= end)]
        for start, end in (scoring.early_s, scoring.late_s)
    )
    rise = float(late.mean() - early.mean()) if len(early) and len(late) else 0.0
    indicator = float(highest.max())
    success = indicator > scoring.min_height and rise > scoring.min_rise
    # Up to the top only: how a rocket falls apart when it comes down says nothing of its rise.
    ratio, cannons = thrust_to_weight(machine, trajectory, joined, int(highest.argmax()) + 1)
    body = positions[:, starting_block(machine, trajectory)]
    sideways = np.linalg.norm(body[:, :2] - body[0, :2], axis=1)
    moving = joined[1:] & joined[:-1]
    metrics: dict[str, Metric] = {
        **cannons,
        "thrust_to_weight": rounded(ratio),
        "rise": rounded(rise),
        "max_speed": rounded(speeds(time_s, positions).max(initial=0.0, where=moving)),
        "lateral_deviation": rounded(sideways.mean()),
        "broken_joints": len(trajectory.breaks),
    }
    flags = ("twr_below_one",) if success and ratio < 1.0 else ()
    return Verdict(
        success=success,
        indicator=rounded(indicator),
        metrics=metrics,
        flags=flags,
        deciding=Deciding(samples=len(time_s), members=joined, cargo=False),
    )
