"""Hover: how long a machine holds its height in the air with its cargo."""

from typing import TYPE_CHECKING, Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scorers.measures.carrying import bears_cargo, is_airborne
from buildarena_benchmark.scorers.measures.components import Mask, joined_to_start
from buildarena_benchmark.scorers.measures.outline import lowest_points
from buildarena_benchmark.scorers.measures.series import starting_block, tilt_deg
from buildarena_benchmark.scorers.measures.unmeasured import unmeasured
from buildarena_benchmark.scorers.scorer import (
    FORCES_NOT_MEASURED,
    NOT_CARRIED,
    Deciding,
    Flag,
    Metric,
    Scorer,
    Verdict,
    raised,
    rounded,
)
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ

if TYPE_CHECKING:
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

_BORNE_SHARE = 0.8
_BORNE_SAMPLES = 25
"""Whether the cargo is borne is judged over a second: forces swing while a machine settles."""


NOT_AIRBORNE: Final = Flag(
    name="not_airborne",
    meaning="The machine was at its height, but touched the ground.",
)


NOT_RISEN: Final = Flag(
    name="not_risen",
    meaning="The starting block was at its height, but the machine did not rise to it: some of it "
    "stayed near the ground, or the block began high up.",
)


class HoverScoring(Document):
    """How long a machine holds a height with its cargo.

    Attributes:
        height: Of the starting block's centre, units.
        band: How far it may be above or below, units.
        hold_s: For how long in a row, seconds.
        max_tilt_deg: Of the starting block against how it stood at the start, degrees.
        max_drift: Horizontal distance of the starting block from its start, units.
        min_clearance: Least height of the machine's lowest point above the ground, units.
        min_rise: Least height of the starting block above where it started, units.
    """

    name: Literal["hover"]
    height: Threshold = 10.0
    band: Threshold = 1.5
    hold_s: Annotated[float, Field(gt=0, le=600)] = 8.0
    max_tilt_deg: Annotated[float, Field(gt=0, le=180)] = 20.0
    max_drift: Threshold = 5.0
    min_clearance: Threshold = 0.0
    min_rise: Threshold = 0.0


def infeasible(scoring: HoverScoring, scenario: Scenario) -> str | None:
    """Why no machine can pass; see `Scorer`."""
    if scenario.cargo is None:
        return "the cargo is carried, but scenario has no cargo"
    if scoring.hold_s > scenario.duration_s:
        return f"hold_s {scoring.hold_s:g} is longer than the trial"
    for name in ("min_clearance", "min_rise"):
        least = getattr(scoring, name)
        if least >= scoring.height + scoring.band:
            return f"{name} {least:g} is above the band, which ends at height + band"
    return None


def judge(
    scoring: HoverScoring, scenario: Scenario, machine: "Machine", trajectory: "Trajectory"
) -> Verdict:
    """The indicator is the longest time in a row within the band, seconds.

    At each moment the starting block must be within the band, nearly upright and near where it
    started, the machine must bear its cargo, nothing of it may touch the ground, and the whole of
    it must have risen: its lowest point above the ground, the starting block above its start.

    Args:
        scoring: Thresholds.
        scenario: What the machine was put through.
        machine: The machine.
        trajectory: The trial.

    Flags:
        `not_airborne`: it would have passed, but touches the ground. `not_carried`: it would have
        passed, but without the cargo. `not_risen`: it would have passed, but for a part near the
        ground, or because it started high up. `forces_not_measured`: cannot be judged.
    """
    lacking = unmeasured(trajectory, cargo=True)
    if lacking is not None:
        return lacking
    joined = joined_to_start(machine, trajectory)
    start = starting_block(machine, trajectory)
    path = trajectory.positions[:, start].astype(np.float64)
    tilt = tilt_deg(trajectory, start)
    drift = np.linalg.norm(path[:, :2] - path[0, :2], axis=1)
    steady = (
        (np.abs(path[:, 2] - scoring.height) <= scoring.band)
        & (tilt < scoring.max_tilt_deg)
        & (drift < scoring.max_drift)
    )
    clearance = lowest_points(machine, trajectory, joined)
    rules: dict[Flag, Mask] = {
        NOT_AIRBORNE: is_airborne(machine, trajectory, joined),
        NOT_CARRIED: bears_cargo(trajectory, share=_BORNE_SHARE, samples=_BORNE_SAMPLES),
        NOT_RISEN: (clearance >= scoring.min_clearance)
        & (path[:, 2] - path[0, 2] >= scoring.min_rise),
    }
    longest = _longest_s(steady & np.all(list(rules.values()), axis=0))
    passes = longest >= scoring.hold_s
    flags = {flag: not passes and _would_hold(scoring, steady, rules, flag) for flag in rules}
    metrics: dict[str, Metric] = {
        "max_height": rounded(path[:, 2].max()),
        "max_tilt": rounded(tilt.max(initial=0.0, where=steady)),
        "drift": rounded(drift.max(initial=0.0, where=steady)),
        "min_clearance": rounded(clearance.min(initial=np.inf, where=steady))
        if steady.any()
        else None,
        "broken_joints": len(trajectory.breaks),
    }
    return Verdict(
        success=passes,
        indicator=rounded(longest),
        metrics=metrics,
        flags=raised(flags),
        deciding=Deciding(samples=len(path), members=joined, cargo=True),
    )


def _would_hold(
    scoring: HoverScoring, steady: Mask, rules: dict[Flag, Mask], without: Flag
) -> bool:
    """Whether it would have held its height for long enough if it were not for one of the rules."""
    others = [mask for flag, mask in rules.items() if flag != without]
    return _longest_s(steady & np.all(others, axis=0)) >= scoring.hold_s


def _longest_s(holds: Mask) -> float:
    """Length of the longest run of samples, seconds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    runs = edges[1::2] - edges[::2] - 1
    return float(runs.max(initial=0)) / SAMPLE_RATE_HZ


SCORER: Final = Scorer(
    parameters=HoverScoring,
    judge=judge,
    infeasible=infeasible,
    flags=(NOT_AIRBORNE, NOT_CARRIED, NOT_RISEN, FORCES_NOT_MEASURED),
)
