"""Walk: how far a machine walks, on feet that are carried through the air in turn."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scorers.measures.balancing import lean_deg
from buildarena_benchmark.scorers.measures.components import joined_to_start
from buildarena_benchmark.scorers.measures.marks import (
    MarkName,
    center_of_mark,
    lacking_mark,
    moving_mark,
    radius_of_mark,
)
from buildarena_benchmark.scorers.measures.series import Series, lasts, starting_block
from buildarena_benchmark.scorers.measures.unmeasured import unmeasured
from buildarena_benchmark.scorers.measures.walking import links_of, touching, walked
from buildarena_benchmark.scorers.scorer import (
    CAME_APART,
    FORCES_NOT_MEASURED,
    Deciding,
    Flag,
    Metric,
    Scorer,
    Verdict,
    raised,
    rounded,
    undriven,
)
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.scenario import GroundPlacement

NOT_WALKED: Final = Flag(
    name="not_walked",
    meaning="The starting block got far enough, but the machine did not walk there: its feet were "
    "not carried in turn, part of it stayed behind, it left its way or turned over.",
)
_EAST, _NORTH = 0, 1
_Measure = Callable[[int, int], Series]


class WalkScoring(Document):
    """How far a machine walks north, and where there is a corner, east from there.

    Attributes:
        min_distance: How far it must walk, from the corner on where there is one, units.
        corner: Name of the mark at which it turns east; None where it only walks north.
        corner_slack: By how much less than to the corner it may have walked there, units: feet are
            carried less far where they were ahead at the start.
        lane: How far the starting block may get from the line that it walks along, units.
        max_tilt_deg: Of the starting block against how it was built, degrees.
        max_part_tilt_deg: Of every other part, degrees.
    """

    name: Literal["walk"]
    min_distance: Threshold = 8.0
    corner: MarkName | None = None
    corner_slack: Threshold = 2.0
    lane: Threshold = 1.5
    max_tilt_deg: Annotated[float, Field(gt=0, lt=90)] = 45.0
    max_part_tilt_deg: Annotated[float, Field(gt=0, lt=180)] = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Leg:
    """A straight part of the way.

    Attributes:
        axis: Along which it leads, 0 east, 1 north.
        length: How far a machine must have walked along it, units.
        line: Where its line lies across that axis, units.
        end: (2,) what the starting block must then be near to; None where that does not matter.
        radius: How near, units.
    """

    axis: int
    length: float
    line: float
    end: Series | None = None
    radius: float = np.inf


def infeasible(scoring: WalkScoring, scenario: Scenario) -> str | None:
    """Why no machine can pass; see `Scorer`."""
    if not isinstance(scenario.placement, GroundPlacement):
        return "a walk is judged, but the machine is not put on the ground"
    if scoring.corner is not None:
        why = lacking_mark(scoring.corner, scenario) or moving_mark(scenario)
        if why is not None:
            return why
        east, north, _ = center_of_mark(scoring.corner, scenario)
        if east != 0 or north <= scoring.corner_slack:
            return f"mark {scoring.corner!r} is not north of the start"
    return undriven(scenario)


def judge(
    scoring: WalkScoring, scenario: Scenario, machine: "Machine", trajectory: "Trajectory"
) -> Verdict:
    """The indicator is how far it walks along its way, units.

    What is joined by anything but a joint that moves is a link, and a link that touches ground or
    terrain is a foot. How far the machine walks is the least of how far the starting block came,
    how far its hindmost point did, and how far each foot was carried through the air by another
    that stood. So what slides, rolls, jumps or stretches does not walk.

    It walks until something comes off, the starting block or another part is tilted too far, or
    the starting block is too far from the line.

    Args:
        scoring: The way and thresholds.
        scenario: Gives terrain and corner.
        machine: Gives the joints.
        trajectory: The trial.

    Flags:
        `came_apart`: it would have passed, but lost parts. `not_walked`: the starting block got far
        enough, but not so. `forces_not_measured`: cannot be judged.
    """
    lacking = unmeasured(trajectory, cargo=False)
    if lacking is not None:
        return lacking
    legs = _legs(scoring, scenario)
    joined, start = joined_to_start(machine, trajectory), starting_block(machine, trajectory)
    whole = joined.all(axis=1)
    path = trajectory.positions[:, start, :2].astype(np.float64)
    upright = _upright(scoring, machine, trajectory, start)
    links = links_of(machine, trajectory)
    touches = touching(scenario, machine, trajectory, links)

    def on_feet(axis: int, since: int) -> Series:
        return walked(machine, trajectory, links, touches, axis=axis, since=since)

    def came(axis: int, since: int) -> Series:
        return np.asarray(path[since:, axis] - path[since, axis])

    along = partial(_walk, legs, path)
    distance, success, end = along(on_feet, upright & whole, lane=scoring.lane)
    with_losses, anyhow = (
        along(measure, holds, lane=lane)[1]
        for measure, holds, lane in (
            (on_feet, upright, scoring.lane),
            (came, np.ones_like(whole), np.inf),
        )
    )
    metrics: dict[str, Metric] = {
        "feet": int(touches.any(axis=0).sum()),
        "steps": _steps(touches[: end + 1]),
        "broken_joints": len(trajectory.breaks),
    }
    flags = {
        CAME_APART: with_losses and not success,
        NOT_WALKED: anyhow and not with_losses,
    }
    return Verdict(
        success=success,
        indicator=rounded(distance),
        metrics=metrics,
        flags=raised(flags),
        deciding=Deciding(samples=end + 1, members=joined, cargo=False),
    )


def _legs(scoring: WalkScoring, scenario: Scenario) -> list[_Leg]:
    if scoring.corner is None:
        return [_Leg(axis=_NORTH, length=scoring.min_distance, line=0.0)]
    corner = center_of_mark(scoring.corner, scenario)[:2]
    north = float(corner[1])
    first = _Leg(
        axis=_NORTH,
        length=north - scoring.corner_slack,
        line=0.0,
        end=corner,
        radius=radius_of_mark(scoring.corner, scenario),
    )
    return [first, _Leg(axis=_EAST, length=scoring.min_distance, line=north)]


def _walk(
    legs: list[_Leg], path: Series, measure: _Measure, holds: NDArray[np.bool_], *, lane: float
) -> tuple[float, bool, int]:
    """How far it gets, whether all the way, and the sample up to which that was looked at.

    Args:
        legs: The way; one begins where the one before it is done.
        path: (T, 2) of the starting block.
        measure: How far it got along an axis since a sample, (T - since,).
        holds: (T,) whether it may go on.
        lane: How far it may get from each leg's line, units.
    """
    since, before = 0, 0.0
    for leg in legs:
        aside = np.abs(path[since:, 1 - leg.axis] - leg.line)
        end = lasts(holds[since:] & (aside <= lane))
        gone = measure(leg.axis, since)[: end + 1]
        done = (gone >= leg.length) & _is_near(leg, path[since : since + end + 1])
        if leg is legs[-1]:
            return before + float(gone.max()), bool(done.any()), since + end
        if not done.any():
            return before + min(float(gone.max()), leg.length), False, since + end
        before += leg.length
        since += int(done.argmax())
    raise AssertionError("a way has at least one leg")


def _is_near(leg: _Leg, path: Series) -> NDArray[np.bool_]:
    """Whether the starting block is as near to the end of a leg as it must be, (T,)."""
    if leg.end is None:
        return np.ones(len(path), dtype=bool)
    return np.asarray(np.linalg.norm(path - leg.end, axis=1) <= leg.radius)


def _upright(
    scoring: WalkScoring, machine: "Machine", trajectory: "Trajectory", start: int
) -> NDArray[np.bool_]:
    """When neither the starting block nor another part is tilted too far, (T,)."""
    tilts = [lean_deg(machine, trajectory, block) for block in range(len(trajectory.block_ids))]
    parts = np.max(tilts, axis=0) < scoring.max_part_tilt_deg
    return np.asarray(parts & (tilts[start] < scoring.max_tilt_deg))


def _steps(touches: NDArray[np.bool_]) -> int:
    """How often a foot was set down."""
    return int((touches[1:] & ~touches[:-1]).sum())


SCORER: Final = Scorer(
    parameters=WalkScoring,
    judge=judge,
    infeasible=infeasible,
    flags=(CAME_APART, NOT_WALKED, FORCES_NOT_MEASURED),
)
