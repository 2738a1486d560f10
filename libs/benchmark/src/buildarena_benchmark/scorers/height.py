"""Lift, levels 2 and 3: how high a rocket rises."""

from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scorers.measures.components import joined_to_start
from buildarena_benchmark.scorers.measures.series import speeds, starting_block
from buildarena_benchmark.scorers.scorer import Deciding, Flag, Metric, Scorer, Verdict, rounded
from buildarena_benchmark.scorers.thrust import thrust_to_weight
from buildarena_simulation import Scenario

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory


TWR_BELOW_ONE: Final = Flag(
    name="twr_below_one",
    meaning="A rocket rose although its thrust is less than its weight.",
    published=True,
)


class HeightScoring(Document):
    """How high a rocket rises.

    Attributes:
        min_height: The indicator must exceed it, units.
        early_s: (2,) first window, seconds, its start excluded.
        late_s: (2,) second window.
        min_rise: The mean height must rise by more from window to window, units.
    """

    name: Literal["height"]
    min_height: Threshold = 30.0
    early_s: tuple[Threshold, Threshold] = (2.0, 7.0)
    late_s: tuple[Threshold, Threshold] = (7.0, 12.0)
    min_rise: Threshold = 5.0


def infeasible(scoring: HeightScoring, scenario: Scenario) -> str | None:
    """Why no machine can pass; see `Scorer`."""
    (start, end), (later, last) = scoring.early_s, scoring.late_s
    if scenario.control.mode == "none":
        return "a rocket is judged, but nothing fires: scenario.control.mode must be held"
    if not start < end <= later < last <= scenario.duration_s:
        return "early_s and late_s must be windows within the trial, one after the other"
    return None


def judge(
    scoring: HeightScoring, scenario: Scenario, machine: "Machine", trajectory: "Trajectory"
) -> Verdict:
    """The indicator is the greatest height of any block that is joined to the starting block.

    The trial succeeds if it exceeds a height and the rocket still rises: the mean height of its
    highest block must grow from one window of time to the next. What has come off counts for
    nothing.

    Args:
        scoring: Thresholds.
        scenario: What the machine was put through.
        machine: Gives the mass.
        trajectory: The trial.

    Flags:
        `twr_below_one`: success although the net thrust is less than the weight.

    Source: the paper, section "Evaluation"; thresholds as in the published evaluation.
    """
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
    # Up to the top only: how a rocket falls apart when it comes down does not concern its rise.
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
    flags = (TWR_BELOW_ONE,) if success and ratio < 1.0 else ()
    return Verdict(
        success=success,
        indicator=rounded(indicator),
        metrics=metrics,
        flags=flags,
        deciding=Deciding(samples=len(time_s), members=joined, cargo=False),
    )


SCORER: Final = Scorer(
    parameters=HeightScoring,
    judge=judge,
    infeasible=infeasible,
    flags=(TWR_BELOW_ONE,),
)
