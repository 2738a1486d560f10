"""Support: how heavy a cargo a bridge carries before it falls into the gap."""

from typing import TYPE_CHECKING

import numpy as np

from buildarena_benchmark.scorers.verdict import Metric, Verdict, rounded
from buildarena_benchmark.tasks.document import SupportScoring

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

_TERRAIN_TOP = 5.0
"""A cargo that never came below the terrains' tops may never have been carried, units."""


def judge(scoring: SupportScoring, machine: "Machine", trajectory: "Trajectory") -> Verdict:
    """The indicator is the cargo's mass when its centre first sinks below the fall height.

    It is the final mass if that never happens, and 0 unless the trial succeeds: the cargo must be
    at or above the fall height for some time in all and must not start too high.

    Args:
        scoring: Thresholds.
        machine: Not looked at; part of every scorer's signature.
        trajectory: The trial; without cargo it fails.

    Flags:
        `start_too_high`: the cargo started above the limit. `never_fell`: it stayed above the
        terrains' tops to the end.

    Source: the paper, section "Evaluation"; thresholds as in the published evaluation.
    """
    del machine
    if trajectory.cargo_position is None or trajectory.cargo_mass is None:
        return Verdict(success=False, indicator=0.0)
    height = trajectory.cargo_position[:, 2].astype(np.float64)
    above = height >= scoring.fall_height
    step = float(np.median(np.diff(trajectory.time_s))) if len(height) > 1 else 0.0
    time_above = float(above.sum()) * step
    too_high = bool(height[0] > scoring.max_start_height)
    success = time_above >= scoring.min_time_s - 1e-9 and not too_high
    fell = np.flatnonzero(~above)
    load = float(trajectory.cargo_mass[fell[0]] if len(fell) else trajectory.cargo_mass[-1])
    flags = []
    if too_high:
        flags.append("start_too_high")
    if not len(fell) and height.min() > _TERRAIN_TOP:
        flags.append("never_fell")
    first = trajectory.breaks[0] if trajectory.breaks else None
    metrics: dict[str, Metric] = {
        "time_above_s": rounded(time_above),
        "lowest_cargo_height": rounded(height.min()),
        "start_height": rounded(height[0]),
        "fall_time_s": rounded(trajectory.time_s[fell[0]]) if len(fell) else None,
        "load_at_first_break": first.cargo_mass if first else None,
        "broken_joints": len(trajectory.breaks),
    }
    return Verdict(
        success=success,
        indicator=rounded(load) if success else 0.0,
        metrics=metrics,
        flags=tuple(flags),
    )
