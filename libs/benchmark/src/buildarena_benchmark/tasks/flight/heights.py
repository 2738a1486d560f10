"""Heights: how long a machine holds one height after the other in the air, with its cargo."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import NOT_AIRBORNE, NOT_CARRIED, Flag
from buildarena_benchmark.scoring.measures.carrying import bears_cargo, is_airborne
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.outline import lowest_points
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import tilt_deg
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ

Stretch = tuple[int, int]
"""First sample, and the one after the last."""
_BORNE_SHARE: Final = 0.8
_BORNE_SAMPLES: Final = 25
"""The cargo's support is averaged over a second: forces swing while a machine settles."""
NOT_RISEN: Final = Flag(
    name="not_risen",
    meaning="The starting block was at its height, but the machine did not rise to it: some of it "
    "stayed near the ground, or the block began high up.",
)


class HeightsScoring(Document):
    """Scoring of how long a machine holds several heights in steady flight with its cargo.

    Attributes:
        max_tilt_deg: Largest tilt of the starting block relative to the start, degrees.
        max_drift: Horizontal distance of the starting block from its start, units.
        min_clearance: Least height of the machine's lowest point above the ground, units.
        min_rise: Least height of the starting block above where it started, units.
        heights: Heights of the starting block's centre, in the order in which they are held, units.
        band: Largest distance above or below, units.
        hold_s: Least time in a row at each height for a success, seconds.
        most_s: Most time at a height that counts, seconds.
    """

    max_tilt_deg: Annotated[float, Field(gt=0, le=180)] = 20.0
    max_drift: Threshold = 5.0
    min_clearance: Threshold = 0.0
    min_rise: Threshold = 0.0
    name: Literal["heights"]
    heights: Annotated[tuple[Threshold, ...], Field(min_length=1, max_length=10)]
    band: Threshold = 0.5
    hold_s: Annotated[float, Field(gt=0, le=600)] = 3.0
    most_s: Annotated[float, Field(gt=0, le=600)] = 10.0


def infeasible(scoring: HeightsScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scenario.cargo is None:
        return "the cargo is carried, but scenario has no cargo"
    if scoring.hold_s > scoring.most_s:
        return f"hold_s {scoring.hold_s:g} is longer than most_s {scoring.most_s:g}"
    if scoring.hold_s * len(scoring.heights) > scenario.duration_s:
        return f"hold_s {scoring.hold_s:g} at every height is longer than the trial"
    for name in ("min_clearance", "min_rise"):
        threshold = getattr(scoring, name)
        if threshold >= min(scoring.heights) + scoring.band:
            return f"{name} {threshold:g} is above the lowest band"
    return None


def judge(scoring: HeightsScoring, run: Run) -> Verdict:
    """Measure the time for which the heights were held, one after the other, seconds.

    Each height counts with one stretch of time within its band, up to a longest, after that of the
    height before; of all such choices the best. In it the machine is nearly upright and near where
    it started, carries its cargo, touches nothing, and has risen as a whole.

    Flags:
        `not_airborne`: it would have passed, but touches the ground. `not_carried`: it would have
        passed, but without the cargo. `not_risen`: it would have passed, but a part is near the
        ground. `forces_not_measured`: cannot be judged.
    """
    path, rules = run.path[:, 2], _rules(scoring, run)
    bands = [np.abs(path - height) <= scoring.band for height in scoring.heights]

    def held(without: Flag | None = None) -> list[float]:
        kept = [holds for flag, holds in rules.items() if flag != without]
        flies = np.all([_is_steady(scoring, run), *kept], axis=0)
        return _held_s([_stretches(band & flies) for band in bands], most_s=scoring.most_s)

    times = held()
    success = min(times) >= scoring.hold_s
    return judged(
        run,
        success=success,
        indicator=sum(times),
        metrics={
            "max_height": path.max(),
            "heights_held": sum(time >= scoring.hold_s for time in times),
            "least_time_held": min(times),
        },
        flags={flag: not success and min(held(flag)) >= scoring.hold_s for flag in rules},
        samples=len(path),
        cargo=True,
    )


def _is_steady(scoring: HeightsScoring, run: Run) -> Mask:
    """Return when the machine is nearly upright and near its start, (T,)."""
    drift = np.linalg.norm(run.path[:, :2] - run.path[0, :2], axis=1)
    tilt = tilt_deg(run.trajectory, run.start)
    return np.asarray((tilt < scoring.max_tilt_deg) & (drift < scoring.max_drift))


def _rules(scoring: HeightsScoring, run: Run) -> Mapping[Flag, Mask]:
    """Return when each rule of flight is kept, (T,), by the flag of those that break it alone."""
    has_room = lowest_points(run, run.joined) >= scoring.min_clearance
    return {
        NOT_AIRBORNE: is_airborne(run),
        NOT_CARRIED: bears_cargo(run, share=_BORNE_SHARE, samples=_BORNE_SAMPLES),
        NOT_RISEN: has_room & (run.path[:, 2] - run.path[0, 2] >= scoring.min_rise),
    }


def _stretches(holds: Mask) -> list[Stretch]:
    """Return the stretches in which something holds: first sample, and the one after the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _held_s(runs: "Sequence[Sequence[Stretch]]", *, most_s: float) -> list[float]:
    """Return how long each height is held in the best choice of a stretch each, in order, seconds.

    Args:
        runs: Stretches in order of time, by height.
        most_s: Most time of a stretch that counts.
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


def explain(scoring: HeightsScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    held = score.metrics.get("heights_held", 0)
    if score.success:
        shortest_s = score.metrics["least_time_held"]
        return f"All {held} heights were held, the shortest for {shortest_s:.1f} s."
    return (
        f"The machine held {held} of {len(scoring.heights)} heights for {scoring.hold_s:g} s, and "
        f"got {score.metrics.get('max_height', 0.0):.1f} high."
    )


SCORER: Final = Scorer(
    parameters=HeightsScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="cargo",
    flags=(NOT_AIRBORNE, NOT_CARRIED, NOT_RISEN),
    ceiling=lambda scoring, _scenario: len(scoring.heights) * scoring.most_s,
)
