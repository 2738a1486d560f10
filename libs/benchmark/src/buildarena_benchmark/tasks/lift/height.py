"""Lift, levels 2 and 3: how high a rocket rises."""

from typing import Final, Literal

import numpy as np

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import Flag
from buildarena_benchmark.scoring.measures.carrying import touches_from_below
from buildarena_benchmark.scoring.measures.outline import lowest_points
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import speeds
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged
from buildarena_benchmark.tasks.lift.thrust import thrust_to_weight
from buildarena_simulation import Scenario

_TAKEN_OFF: Final = 1.0
"""A rocket has taken off when its starting block is so far above its start, units."""

_GROUNDED: Final = 0.1
"""Height at which a part touches the ground, units: forces need not show it."""


TWR_BELOW_ONE: Final = Flag(
    name="twr_below_one",
    meaning="A rocket rose although its thrust is less than its weight.",
)


class HeightScoring(Document):
    """Scoring of how high a rocket rises.

    Attributes:
        min_height: Indicator that must be exceeded, units.
        early_s: (2,) first window, seconds, its start excluded.
        late_s: (2,) second window.
        min_rise: Rise of the mean height between the windows that must be exceeded, units.
    """

    name: Literal["height"]
    min_height: Threshold = 30.0
    early_s: tuple[Threshold, Threshold] = (2.0, 7.0)
    late_s: tuple[Threshold, Threshold] = (7.0, 12.0)
    min_rise: Threshold = 5.0


def infeasible(scoring: HeightScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    (start, end), (later, last) = scoring.early_s, scoring.late_s
    if scenario.control.mode == "none":
        return "a rocket is judged, but nothing fires: scenario.control.mode must be held"
    if not start < end <= later < last <= scenario.duration_s:
        return "early_s and late_s must be windows within the trial, one after the other"
    return None


def judge(scoring: HeightScoring, run: Run) -> Verdict:
    """Measure the greatest height of any block that is joined to the starting block.

    The trial succeeds if it exceeds a height and the rocket still rises: the mean height of its
    highest block must grow from one window of time to the next. What has come off counts for
    nothing, and neither does what follows once a rocket that has taken off touches the ground.

    Flags:
        `twr_below_one`: success although the net thrust is less than the weight.

    Source: the paper, section "Evaluation"; thresholds as in the published evaluation.
    """
    time_s = run.time_s
    flown = _first_flight(run)
    highest = np.where(run.joined, run.positions[:, :, 2], -np.inf).max(axis=1)[:flown]
    early, late = (
        highest[(time_s[:flown] > begin) & (time_s[:flown] <= end)]
        for begin, end in (scoring.early_s, scoring.late_s)
    )
    rise = float(late.mean() - early.mean()) if len(early) and len(late) else 0.0
    indicator = float(highest.max())
    success = indicator > scoring.min_height and rise > scoring.min_rise
    # Up to the top only: how a rocket falls apart when it comes down does not concern its rise.
    ratio, cannons = thrust_to_weight(run, int(highest.argmax()) + 1)
    sideways = np.linalg.norm(run.path[:, :2] - run.path[0, :2], axis=1)
    moving = run.joined[1:] & run.joined[:-1]
    return judged(
        run,
        success=success,
        indicator=indicator,
        flags={TWR_BELOW_ONE: success and ratio < 1.0},
        metrics={
            **cannons,
            "thrust_to_weight": ratio,
            "rise": rise,
            "max_speed": speeds(time_s, run.positions).max(initial=0.0, where=moving),
            "lateral_deviation": sideways.mean(),
            "landed_s": None if flown == len(time_s) else time_s[flown],
        },
        samples=len(time_s),
    )


def _first_flight(run: Run) -> int:
    """Return how many samples there are before a rocket that has taken off touches the ground."""
    height = run.path[:, 2]
    low = lowest_points(run, run.joined)
    # Between two samples it may have touched and bounced: it would be below the ground by now.
    steps = np.diff(low, prepend=low[0])
    coming = np.concatenate([[False], (low[:-1] + np.minimum(steps[:-1], 0.0)) <= 0.0])
    touches = (low <= _GROUNDED) | coming
    if run.trajectory.bearing is not None:
        touches |= touches_from_below(run)
    flies = ~touches & (height - height[0] >= _TAKEN_OFF)
    if not flies.any():
        return len(height)
    landings = np.flatnonzero(touches[flies.argmax() :])
    return int(flies.argmax() + landings[0]) if len(landings) else len(height)


def explain(scoring: HeightScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if "rise" not in metrics:
        return f"The rocket did not leave the ground; a height of {scoring.min_height:g} is asked."
    (early, until), late = scoring.early_s, scoring.late_s[1]
    if score.indicator < scoring.min_height:
        return f"The rocket reached {score.indicator:.1f}; {scoring.min_height:g} is asked."
    if score.success:
        return f"The rocket reached {score.indicator:,.0f} and was still rising."
    return (
        f"The rocket reached {score.indicator:.1f}, but rose by {metrics['rise']:.1f} from "
        f"{early:g}-{until:g} s to {until:g}-{late:g} s, and {scoring.min_rise:g} is asked."
    )


SCORER: Final = Scorer(
    parameters=HeightScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="places",
    flags=(TWR_BELOW_ONE,),
)
