"""Winch: how high a cargo is raised, and held when no key is pressed."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from buildarena_benchmark.scorers.carrying import bears_cargo, stands
from buildarena_benchmark.scorers.pieces import Mask, joined_to_start
from buildarena_benchmark.scorers.unmeasured import unmeasured
from buildarena_benchmark.scorers.verdict import Deciding, Metric, Verdict, rounded
from buildarena_benchmark.tasks.workshop_scoring import WinchScoring
from buildarena_simulation.constants import SAMPLE_RATE_HZ

if TYPE_CHECKING:
    from buildarena_benchmark.scorers.series import Series
    from buildarena_benchmark.tasks.task import Task
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory


def judge(task: "Task", machine: "Machine", trajectory: "Trajectory") -> Verdict:
    """The indicator is the height held, times the cargo's mass.

    The height is the least of the cargo's heights above where it stood, over the best stretch of
    time after all keys were let go in which it varies little, the machine is whole, bears the
    cargo, and stands on the ground with it.

    Args:
        task: Thresholds.
        machine: The machine.
        trajectory: The trial.

    Flags:
        `not_carried`: high enough for long enough, but not by the machine. `not_standing`: the
        ground did not bear machine and cargo. `came_apart`: parts came off. `forces_not_measured`:
        cannot be judged.
    """
    scoring, scenario = task.scoring, task.scenario
    assert isinstance(scoring, WinchScoring)  # noqa: S101 - the scorer is chosen by it
    lacking = unmeasured(trajectory, cargo=True)
    if lacking is not None:
        return lacking
    assert trajectory.cargo_position is not None  # noqa: S101 - it was looked at
    assert trajectory.cargo_mass is not None  # noqa: S101
    joined = joined_to_start(machine, trajectory)
    height = trajectory.cargo_position[:, 2].astype(np.float64)
    height -= height[0]
    free = trajectory.time_s >= (scenario.control.until_s or 0.0)
    rules: dict[str, Mask] = {
        "not_carried": bears_cargo(trajectory, share=0.8),
        "not_standing": stands(machine, trajectory, joined),
        "came_apart": np.asarray(joined.all(axis=1)),
    }
    held = _held(scoring, height, free & np.all(list(rules.values()), axis=0))
    passes = held >= scoring.min_rise
    flags = [
        name
        for name in rules
        if not passes and _held_but_for(scoring, height, free, rules, name) >= scoring.min_rise
    ]
    metrics: dict[str, Metric] = {
        "held_height": rounded(held),
        "max_height": rounded(height.max(initial=0.0)),
        "broken_joints": len(trajectory.breaks),
    }
    return Verdict(
        success=passes,
        indicator=rounded(held * float(trajectory.cargo_mass[-1])),
        metrics=metrics,
        flags=tuple(flags),
        deciding=Deciding(samples=len(height), members=joined, cargo=True),
    )


def _held(scoring: WinchScoring, height: "Series", counts: "Mask") -> float:
    """The greatest height that is held, units; 0 if none is."""
    length = round(scoring.hold_s * SAMPLE_RATE_HZ) + 1
    if length > len(height):
        return 0.0
    windows = sliding_window_view(height, length)
    low = windows.min(axis=1)
    steady = windows.max(axis=1) - low <= 2.0 * scoring.max_play
    whole = sliding_window_view(counts, length).all(axis=1)
    return float(low.max(initial=0.0, where=steady & whole))


def _held_but_for(
    scoring: WinchScoring, height: "Series", free: "Mask", rules: dict[str, "Mask"], name: str
) -> float:
    """What would be held if it were not for one of the rules."""
    others = [mask for other, mask in rules.items() if other != name]
    return _held(scoring, height, free & np.all(others, axis=0))
