"""Rough road: how far, and how gently, a cargo is driven over bumps."""

from typing import Final, Literal

import numpy as np

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import NOT_CARRIED, NOT_DRIVEN
from buildarena_benchmark.scoring.measures.carrying import bears_cargo
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.rolling import driven_distances, moved_upright
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, gravity_of, rotations
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ

_MOVING: Final = 0.5
"""Slower machines count as waiting, units/s: that makes no ride gentler."""

_MOVING_SAMPLES: Final = 12
"""Number of samples over which speed is judged, half a second."""

_BORNE_SAMPLES: Final = 25
"""The cargo's support is averaged over a second: it may hop."""


class RoadScoring(Document):
    """Scoring of how far, and how gently, a vehicle carries a cargo over a rough road northwards.

    Attributes:
        min_distance: Distance that must be exceeded, units.
        max_rms: Bound of the root mean square of the cargo's vertical acceleration, g.
        max_shift: Largest distance of the cargo from its place on the machine, units.
        settle_s: Time at which the cargo's place is taken, and accelerations begin to count,
            seconds.
        half_width: Half the road's width about x = 0, units; nothing counts beyond it.
        length: Length of the road, units; larger distances count as this.
    """

    name: Literal["road"]
    min_distance: Threshold = 30.0
    max_rms: Threshold = 1.0
    max_shift: Threshold = 1.5
    settle_s: Threshold = 2.0
    half_width: Threshold = 15.0
    length: Threshold = 36.0


def infeasible(scoring: RoadScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scenario.cargo is None:
        return "the cargo is judged, but scenario has no cargo"
    if scoring.settle_s >= scenario.duration_s:
        return f"settle_s {scoring.settle_s:g} is not within the trial"
    if scoring.length <= scoring.min_distance:
        return f"the road's length {scoring.length:g} does not exceed min_distance"
    return undriven(scenario)


def judge(scoring: RoadScoring, run: Run) -> Verdict:
    """Measure the distance northwards over 1 + the RMS of the cargo's acceleration in g.

    The distance is the starting block's, as far as wheels drove it (see `driven_distances`), on the
    road, and while the cargo stays near its place on the machine, on top of it. The acceleration
    is vertical, and counts while the machine moves, from when the cargo has settled until the
    machine has got farthest, or to the road's end.

    Flags:
        `not_driven`: far enough, but not by wheels. `not_carried`: far enough, but without the
        cargo. `forces_not_measured`: cannot be judged.
    """
    path = run.path
    on_road = np.logical_and.accumulate(np.abs(path[:, 0]) <= scoring.half_width)
    ahead = np.where(on_road, np.minimum(path[:, 1] - path[0, 1], scoring.length), 0.0)
    driven = driven_distances(run, path)
    reach = np.zeros_like(ahead) if driven is None else driven
    counted = np.minimum(ahead, np.minimum(reach, moved_upright(run, path)))
    keeps, shift = _keeps_cargo(scoring, run, path)
    distances = np.where(keeps, counted, 0.0)
    distance, farthest = float(distances.max(initial=0.0)), int(distances.argmax())
    rms = _ride(scoring, run, path, farthest)
    far_enough = distance > scoring.min_distance
    flags = {
        NOT_DRIVEN: ahead.max() > scoring.min_distance >= counted.max(),
        NOT_CARRIED: counted.max() > scoring.min_distance and not far_enough,
    }
    return judged(
        run,
        success=far_enough and rms < scoring.max_rms,
        indicator=distance / (1.0 + rms),
        flags=flags,
        metrics={
            "distance": distance,
            "rms_acceleration": rms,
            "cargo_shift": shift[: farthest + 1].max(initial=0.0),
        },
        samples=len(path),
        cargo=True,
    )


def _keeps_cargo(scoring: RoadScoring, run: Run, path: Series) -> tuple[Mask, Series]:
    """Return when the machine still has its cargo, (T,), and the cargo's offset, (T,) units."""
    turns = rotations(run.trajectory.quaternions[:, run.start])
    offset = run.cargo_path - path
    place = np.einsum("tji,tj->ti", turns, offset)
    settled = int(np.searchsorted(run.time_s, scoring.settle_s - 1e-9))
    settled = min(settled, len(place) - 1)
    shift = np.linalg.norm(place - place[settled], axis=1)
    shift[:settled] = 0.0
    keeps = (shift <= scoring.max_shift) & bears_cargo(run, samples=_BORNE_SAMPLES)
    keeps[:settled] = True
    return np.logical_and.accumulate(keeps), shift


def _ride(scoring: RoadScoring, run: Run, path: Series, farthest: int) -> float:
    """Return the RMS of the cargo's vertical acceleration on its way, g."""
    height = run.cargo_path[:, 2]
    pull = np.zeros(len(height))
    pull[1:-1] = np.diff(height, 2) * SAMPLE_RATE_HZ**2 / gravity_of(run.trajectory)
    before = np.maximum(np.arange(len(path)) - _MOVING_SAMPLES, 0)
    moved = np.linalg.norm(path[:, :2] - path[before, :2], axis=1)
    counts = (moved > _MOVING * _MOVING_SAMPLES / SAMPLE_RATE_HZ) & (run.time_s >= scoring.settle_s)
    counts[farthest + 1 :] = False
    return float(np.sqrt(np.mean(pull[counts] ** 2))) if counts.any() else 0.0


def explain(scoring: RoadScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if "distance" not in metrics:
        return "No wheel was driven."
    rode = f"The cargo rode {metrics['distance']:.1f} at {metrics['rms_acceleration']:.2f} g"
    if score.success:
        return f"{rode}."
    return f"{rode}; {scoring.min_distance:g} at no more than {scoring.max_rms:g} g is asked."


SCORER: Final = Scorer(
    parameters=RoadScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="cargo",
    flags=(NOT_DRIVEN, NOT_CARRIED),
    ceiling=lambda scoring, _scenario: scoring.length,
)
