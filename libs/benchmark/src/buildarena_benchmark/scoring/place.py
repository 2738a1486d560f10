"""Pick and place: how near to a mark a cargo is put down, perhaps beyond a wall."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import BASE_MOVED, CAME_APART, NOT_CARRIED
from buildarena_benchmark.scoring.measures.carrying import bears_cargo
from buildarena_benchmark.scoring.measures.marks import MarkName, mark_of, unusable_mark
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ

_BORNE_SAMPLES: Final = 5
"""The cargo's support is averaged over a fifth of a second: a throw shows."""

_PUT_DOWN: Final = 0.1
"""Largest share of a cargo's weight on the machine once it was put down."""

_SLACK: Final = 0.05
"""A cargo that slides along the wall's top sinks in so far, units."""


class PlaceScoring(Document):
    """Scoring of how near to a mark a cargo is put down.

    Attributes:
        mark: Name of the mark in the scenario.
        max_distance: Largest distance from the mark at rest, units.
        min_carry: Least horizontal distance from the cargo's first place, units.
        clearance: Least height of the cargo's underside halfway between its place and the mark,
            units.
        rest_s: Least time at rest at the end, seconds.
        max_speed: Largest speed at rest, units/s.
        max_base_shift: Largest shift of the starting block, units.
        max_loose: Largest way in all while the machine does not carry the cargo, units.
        must_rest: Whether the indicator counts only for a cargo at rest at the end, released by the
            machine.
    """

    name: Literal["place"]
    mark: MarkName = "goal"
    max_distance: Threshold = 1.0
    min_carry: Threshold = 6.0
    clearance: Threshold = 2.0
    rest_s: Annotated[float, Field(gt=0, le=600)] = 2.0
    max_speed: Threshold = 0.1
    max_base_shift: Threshold = 0.5
    max_loose: Threshold = 1.5
    must_rest: Annotated[bool, Field(exclude_if=lambda value: not value)] = False


def infeasible(scoring: PlaceScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scenario.cargo is None or scenario.cargo.at is None:
        return "the cargo is carried from its place, but scenario.cargo has none: give cargo.at"
    lacking = unusable_mark(scoring.mark, scenario)
    if lacking is not None:
        return lacking
    mark = mark_of(scoring.mark, scenario)
    way = np.array(mark.center[:2]) - np.array(scenario.cargo.at[:2])
    if np.linalg.norm(way) + scoring.max_distance < scoring.min_carry:
        return f"the mark is nearer to the cargo than min_carry {scoring.min_carry:g}"
    if scoring.rest_s >= scenario.duration_s:
        return f"rest_s {scoring.rest_s:g} is longer than the trial"
    return undriven(scenario)


def judge(scoring: PlaceScoring, run: Run) -> Verdict:
    """Measure 1 / (1 + d) where the cargo comes to rest d from the mark.

    It counts for a cargo that the machine carried over the obstacle: whose underside was high
    enough halfway, and that moved little while the machine did not carry it. A cargo that was
    thrown, kicked, pushed along the ground or taken round a wall scores 0.

    Flags:
        `not_carried`: it lies at the mark, but was not carried there. `base_moved`: the starting
        block did not stay. `came_apart`: parts came off. `forces_not_measured`: cannot be judged.
    """
    mark = np.array(mark_of(scoring.mark, run.scenario).center)
    path = run.cargo_path
    base_shift = float(np.linalg.norm(run.path - run.path[0], axis=1).max())
    loose = _loose_way(run, path)
    distance = float(np.linalg.norm(path[-1, :2] - mark[:2]))
    carried = loose <= scoring.max_loose and _passes_over(scoring, run, path, mark[:2])
    stays = base_shift < scoring.max_base_shift
    intact = bool(run.joined.all())
    rests = _rests(scoring, run, path)
    lies = (
        distance <= scoring.max_distance
        and float(np.linalg.norm(path[-1, :2] - path[0, :2])) >= scoring.min_carry
        and rests
    )
    flags = {
        NOT_CARRIED: lies and not carried,
        BASE_MOVED: lies and not stays,
        CAME_APART: lies and not intact,
    }
    counts = carried and stays and intact
    return judged(
        run,
        success=lies and counts,
        indicator=1.0 / (1.0 + distance) if counts and (rests or not scoring.must_rest) else 0.0,
        flags=flags,
        metrics={
            "distance_to_mark": distance,
            "carried": carried,
            "loose_way": loose,
            "base_shift": base_shift,
            "max_height": path[:, 2].max() - path[0, 2],
        },
        samples=len(path),
        cargo=True,
    )


def _loose_way(run: Run, path: Series) -> float:
    """Return how far the cargo moved in all while the machine did not carry it, units."""
    carried = bears_cargo(run, samples=_BORNE_SAMPLES)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    return float(steps.sum(where=~carried[1:]))


def _passes_over(scoring: PlaceScoring, run: Run, path: Series, mark: Series) -> bool:
    """Return whether the cargo was high enough, and carried, each time halfway to the mark."""
    way = mark - path[0, :2]
    ahead = (path[:, :2] - path[0, :2]) @ way / max(float(way @ way), 1e-9) - 0.5
    samples = np.flatnonzero((ahead[:-1] < 0.0) & (ahead[1:] >= 0.0)) + 1
    if not len(samples):
        return False
    reach = np.abs(run.cargo_turns[:, 2]) @ (run.cargo_size / 2)
    underside = path[:, 2] - reach
    carried = bears_cargo(run, samples=_BORNE_SAMPLES)
    high = underside >= scoring.clearance - _SLACK
    return bool((high & carried)[samples].all())


def _rests(scoring: PlaceScoring, run: Run, path: Series) -> bool:
    """Return whether the cargo lies still at the end, and not on the machine."""
    count = round(scoring.rest_s * SAMPLE_RATE_HZ)
    if count >= len(path):
        return False
    steps = np.linalg.norm(np.diff(path[-count - 1 :], axis=0), axis=1) * SAMPLE_RATE_HZ
    load = float(np.abs(run.bearing.cargo[-count:]).mean())
    weight = float(run.cargo_mass[-count:].mean())
    return bool((steps < scoring.max_speed).all()) and load <= _PUT_DOWN * weight


def explain(scoring: PlaceScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if "distance_to_mark" not in metrics:
        return "Nothing was put down."
    if metrics["distance_to_mark"] > scoring.max_distance:
        return (
            f"The cargo ended {metrics['distance_to_mark']:.2f} from its mark; at most "
            f"{scoring.max_distance:g} is allowed."
        )
    if score.success:
        return f"The cargo was put down {metrics['distance_to_mark']:.2f} from its mark."
    loose, shift, broken = (metrics[name] for name in ("loose_way", "base_shift", "broken_joints"))
    faults = {
        f"it moved {loose:.1f} while nothing held it; {scoring.max_loose:g} is allowed": (
            loose > scoring.max_loose
        ),
        f"it was not carried {scoring.clearance:g} high halfway": not metrics["carried"],
        f"the base moved by {shift:.2f}; {scoring.max_base_shift:g} is allowed": (
            shift >= scoring.max_base_shift
        ),
        f"joints broke: {broken}": broken > 0,
    }
    rest = f"it was still held, or not at rest, in the last {scoring.rest_s:g} s"
    fault = next((fault for fault, holds in faults.items() if holds), rest)
    return f"The cargo ended {metrics['distance_to_mark']:.2f} from its mark, but {fault}."


SCORER: Final = Scorer(
    parameters=PlaceScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="cargo",
    flags=(NOT_CARRIED, BASE_MOVED, CAME_APART),
    ceiling=lambda _scoring, _scenario: 1.0,
)
