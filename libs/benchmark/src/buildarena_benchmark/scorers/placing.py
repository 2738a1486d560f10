"""Pick and place: how near to a mark a cargo is put down, beyond a wall."""

from typing import TYPE_CHECKING, Final

import numpy as np

from buildarena_benchmark.scorers.carrying import bears_cargo
from buildarena_benchmark.scorers.pieces import joined_to_start
from buildarena_benchmark.scorers.series import Series, rotations, starting_block
from buildarena_benchmark.scorers.unmeasured import unmeasured
from buildarena_benchmark.scorers.verdict import Deciding, Metric, Verdict, rounded
from buildarena_benchmark.tasks.workshop_scoring import PlaceScoring
from buildarena_simulation.constants import SAMPLE_RATE_HZ

if TYPE_CHECKING:
    from buildarena_benchmark.tasks.task import Task
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory

NEAREST: Final = 0.1
"""Nearer to the mark counts no more, units: the cargo's place is drawn as finely."""

_BORNE_SAMPLES: Final = 5
"""Whether the cargo is borne is judged over a fifth of a second: a throw shows."""

_PUT_DOWN: Final = 0.1
"""Largest share of its weight that the machine bears of a cargo that was put down."""

_SLACK: Final = 0.05
"""A cargo that slides along the wall's top sinks in so far, units."""


def judge(task: "Task", machine: "Machine", trajectory: "Trajectory") -> Verdict:
    """The indicator is one over the distance from the mark at which the cargo comes to rest.

    It counts for a cargo that the machine carried over the wall: whose underside was high enough
    halfway, and that moved little while the machine did not bear it. A cargo that was thrown,
    kicked, pushed along the ground or taken round the wall scores 0.

    Args:
        task: Thresholds, and the mark.
        machine: The machine.
        trajectory: The trial.

    Flags:
        `not_carried`: it lies at the mark, but was not carried there. `base_moved`: the starting
        block did not stay. `came_apart`: parts came off. `forces_not_measured`: cannot be judged.
    """
    scoring, scenario = task.scoring, task.scenario
    assert isinstance(scoring, PlaceScoring)  # noqa: S101 - the scorer is chosen by it
    lacking = unmeasured(trajectory, cargo=True)
    if lacking is not None:
        return lacking
    assert trajectory.cargo_position is not None  # noqa: S101 - it was looked at
    mark = next(m for m in scenario.marks if m.name == scoring.mark)
    path = trajectory.cargo_position.astype(np.float64)
    joined = joined_to_start(machine, trajectory)
    base = trajectory.positions[:, starting_block(machine, trajectory)].astype(np.float64)
    base_shift = float(np.linalg.norm(base - base[0], axis=1).max())
    loose = _loose_way(trajectory, path)
    apart = float(np.linalg.norm(path[-1, :2] - np.array(mark.center[:2])))
    carried = loose <= scoring.max_loose and _passes_over(
        scoring, trajectory, path, np.array(mark.center[:2])
    )
    stays = base_shift < scoring.max_base_shift
    whole = bool(joined.all())
    lies = (
        apart <= scoring.max_distance
        and float(np.linalg.norm(path[-1, :2] - path[0, :2])) >= scoring.min_carry
        and _rests(scoring, trajectory, path)
    )
    flags = {
        "not_carried": lies and not carried,
        "base_moved": lies and not stays,
        "came_apart": lies and not whole,
    }
    metrics: dict[str, Metric] = {
        "distance_to_mark": rounded(apart),
        "carried": carried,
        "loose_way": rounded(loose),
        "base_shift": rounded(base_shift),
        "max_height": rounded(path[:, 2].max() - path[0, 2]),
        "broken_joints": len(trajectory.breaks),
    }
    counts = carried and stays and whole
    return Verdict(
        success=lies and counts,
        indicator=rounded(1.0 / max(apart, NEAREST)) if counts else 0.0,
        metrics=metrics,
        flags=tuple(flag for flag, holds in flags.items() if holds),
        deciding=Deciding(samples=len(path), members=joined, cargo=True),
    )


def _loose_way(trajectory: "Trajectory", path: Series) -> float:
    """How far the cargo moved in all while the machine did not bear it, units."""
    borne = bears_cargo(trajectory, samples=_BORNE_SAMPLES)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    return float(steps.sum(where=~borne[1:]))


def _passes_over(
    scoring: PlaceScoring, trajectory: "Trajectory", path: Series, mark: Series
) -> bool:
    """Whether the cargo was high enough, and borne, each time it came halfway to the mark."""
    assert trajectory.cargo_quaternion is not None  # noqa: S101 - there is a cargo
    assert trajectory.cargo_size is not None  # noqa: S101
    way = mark - path[0, :2]
    ahead = (path[:, :2] - path[0, :2]) @ way / max(float(way @ way), 1e-9) - 0.5
    samples = np.flatnonzero((ahead[:-1] < 0.0) & (ahead[1:] >= 0.0)) + 1
    if not len(samples):
        return False
    half = np.array(trajectory.cargo_size) / 2
    reach = np.abs(rotations(trajectory.cargo_quaternion)[:, 2]) @ half
    underside = path[:, 2] - reach
    borne = bears_cargo(trajectory, samples=_BORNE_SAMPLES)
    high = underside >= scoring.clearance - _SLACK
    return bool((high & borne)[samples].all())


def _rests(scoring: PlaceScoring, trajectory: "Trajectory", path: Series) -> bool:
    """Whether the cargo lies still at the end, and not on the machine."""
    assert trajectory.bearing is not None  # noqa: S101 - the caller looked
    assert trajectory.cargo_mass is not None  # noqa: S101
    count = round(scoring.rest_s * SAMPLE_RATE_HZ)
    if count >= len(path):
        return False
    steps = np.linalg.norm(np.diff(path[-count - 1 :], axis=0), axis=1) * SAMPLE_RATE_HZ
    load = float(np.abs(trajectory.bearing.cargo[-count:]).mean())
    weight = float(trajectory.cargo_mass[-count:].mean())
    return bool((steps < scoring.max_speed).all()) and load <= _PUT_DOWN * weight
