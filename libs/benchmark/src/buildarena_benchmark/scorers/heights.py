"""Heights: how long a machine holds one height after the other in the air, with its cargo."""

from typing import TYPE_CHECKING, Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scorers.hover import NOT_AIRBORNE, NOT_RISEN
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
    from collections.abc import Sequence

    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

_BORNE_SHARE: Final = 0.8
_BORNE_SAMPLES: Final = 25
"""Whether the cargo is borne is judged over a second, as in hovering."""

Run = tuple[int, int]
"""First sample, and the one after the last."""


class HeightsScoring(Document):
    """How long a machine holds one height after the other with its cargo.

    Attributes:
        heights: Of the starting block's centre, in the order in which they are held, units.
        band: How far it may be above or below, units.
        hold_s: For how long in a row each must be held in a trial that passes, seconds.
        most_s: More than that counts no more, seconds.
        max_tilt_deg: Of the starting block against how it stood at the start, degrees.
        max_drift: Horizontal distance of the starting block from its start, units.
        min_clearance: Least height of the machine's lowest point above the ground, units.
        min_rise: Least height of the starting block above where it started, units.
    """

    name: Literal["heights"]
    heights: Annotated[tuple[Threshold, ...], Field(min_length=1, max_length=10)]
    band: Threshold = 0.5
    hold_s: Annotated[float, Field(gt=0, le=600)] = 3.0
    most_s: Annotated[float, Field(gt=0, le=600)] = 10.0
    max_tilt_deg: Annotated[float, Field(gt=0, le=180)] = 20.0
    max_drift: Threshold = 5.0
    min_clearance: Threshold = 0.0
    min_rise: Threshold = 0.0


def infeasible(scoring: HeightsScoring, scenario: Scenario) -> str | None:
    """Why no machine can pass; see `Scorer`."""
    if scenario.cargo is None:
        return "the cargo is carried, but scenario has no cargo"
    if scoring.hold_s > scoring.most_s:
        return f"hold_s {scoring.hold_s:g} is longer than most_s {scoring.most_s:g}"
    if scoring.hold_s * len(scoring.heights) > scenario.duration_s:
        return f"hold_s {scoring.hold_s:g} at every height is longer than the trial"
    for name in ("min_clearance", "min_rise"):
        least = getattr(scoring, name)
        if least >= min(scoring.heights) + scoring.band:
            return f"{name} {least:g} is above the lowest band"
    return None


def judge(
    scoring: HeightsScoring, scenario: Scenario, machine: "Machine", trajectory: "Trajectory"
) -> Verdict:
    """The indicator is the time for which the heights were held, one after the other, seconds.

    Each height counts with one stretch of time within its band, up to a longest, after that of the
    height before; of all such choices the best. In it the machine is nearly upright and near where
    it started, bears its cargo, touches nothing, and has risen as a whole, as for `hover`.

    Args:
        scoring: Heights and thresholds.
        scenario: What the machine was put through.
        machine: The machine.
        trajectory: The trial.

    Flags:
        `not_airborne`: it would have passed, but touches the ground. `not_carried`: it would have
        passed, but without the cargo. `not_risen`: it would have passed, but for a part near the
        ground. `forces_not_measured`: cannot be judged.
    """
    del scenario
    lacking = unmeasured(trajectory, cargo=True)
    if lacking is not None:
        return lacking
    joined = joined_to_start(machine, trajectory)
    start = starting_block(machine, trajectory)
    path = trajectory.positions[:, start].astype(np.float64)
    drift = np.linalg.norm(path[:, :2] - path[0, :2], axis=1)
    steady = (tilt_deg(trajectory, start) < scoring.max_tilt_deg) & (drift < scoring.max_drift)
    rules: dict[Flag, Mask] = {
        NOT_AIRBORNE: is_airborne(machine, trajectory, joined),
        NOT_CARRIED: bears_cargo(trajectory, share=_BORNE_SHARE, samples=_BORNE_SAMPLES),
        NOT_RISEN: (lowest_points(machine, trajectory, joined) >= scoring.min_clearance)
        & (path[:, 2] - path[0, 2] >= scoring.min_rise),
    }

    def held(counts: Mask) -> list[float]:
        bands = [np.abs(path[:, 2] - height) <= scoring.band for height in scoring.heights]
        return _held_s([_runs(band & counts) for band in bands], most_s=scoring.most_s)

    def passes(counts: Mask) -> bool:
        return min(held(counts)) >= scoring.hold_s

    everything = steady & np.all(list(rules.values()), axis=0)
    times = held(everything)
    success = passes(everything)
    flags = {
        flag: not success
        and passes(steady & np.all([rules[other] for other in rules if other != flag], axis=0))
        for flag in rules
    }
    metrics: dict[str, Metric] = {
        "max_height": rounded(path[:, 2].max()),
        "heights_held": sum(time >= scoring.hold_s for time in times),
        "least_time_held": rounded(min(times)),
        "broken_joints": len(trajectory.breaks),
    }
    return Verdict(
        success=success,
        indicator=rounded(sum(times)),
        metrics=metrics,
        flags=raised(flags),
        deciding=Deciding(samples=len(path), members=joined, cargo=True),
    )


def _runs(holds: Mask) -> list[Run]:
    """The stretches in which something holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _held_s(runs: "Sequence[Sequence[Run]]", *, most_s: float) -> list[float]:
    """For how long each height is held in the best choice of a stretch each, in order, seconds.

    Args:
        runs: By height, its stretches in order of time.
        most_s: A longer one counts as that.
    """
    best: dict[int, list[float]] = {0: []}  # by when the last stretch of the choice ends
    for stretches in runs:
        grown = {end: [*times, 0.0] for end, times in best.items()}
        for first, after in stretches:
            lasts = min((after - first - 1) / SAMPLE_RATE_HZ, most_s)
            before = [times for end, times in best.items() if end <= first]
            times = [*max(before, key=sum), lasts]
            if sum(times) > sum(grown.get(after, [])) or after not in grown:
                grown[after] = times
        best = grown
    return max(best.values(), key=sum)


SCORER: Final = Scorer(
    parameters=HeightsScoring,
    judge=judge,
    infeasible=infeasible,
    flags=(NOT_AIRBORNE, NOT_CARRIED, NOT_RISEN, FORCES_NOT_MEASURED),
)
