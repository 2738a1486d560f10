"""Support: how heavy a cargo a bridge carries before it falls into the gap."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from buildarena_benchmark.scorers.pieces import Mask, spans_of
from buildarena_benchmark.scorers.spanning import (
    Span,
    deciding_sample,
    is_lost,
    measure_span,
    terrain_sides,
)
from buildarena_benchmark.scorers.verdict import Deciding, Metric, Verdict, rounded
from buildarena_benchmark.tasks.document import SupportScoring

if TYPE_CHECKING:
    from buildarena_benchmark.tasks.task import Task
    from buildarena_geometry import Machine
    from buildarena_simulation import Trajectory


def judge(task: "Task", machine: "Machine", trajectory: "Trajectory") -> Verdict:
    """The indicator is the cargo's mass at the first moment it is not carried over the gap.

    That is when its centre sinks below the fall height or leaves the gap to either terrain; it is
    the final mass if that never happens. The trial succeeds if the cargo was carried for some time
    in all, did not start too high, and the load went to both terrains; the indicator is 0
    otherwise.

    Args:
        task: Thresholds, gap and terrains.
        machine: Gives masses.
        trajectory: The trial; without cargo it fails.

    Flags:
        `start_too_high`: the cargo started above the limit. `does_not_span`: the load did not go
        to both terrains; see `Span`. `never_fell`: everything was carried, so the indicator is
        only a lower bound. `span_not_measured`: no contact forces are known.

    Source: the paper, section "Evaluation"; thresholds as in the published evaluation.
    """
    scoring = task.scoring
    assert isinstance(scoring, SupportScoring)  # noqa: S101 - the scorer is chosen by it
    if trajectory.cargo_position is None or trajectory.cargo_mass is None:
        return Verdict(success=False, indicator=0.0)
    height = trajectory.cargo_position[:, 2].astype(np.float64)
    decided = deciding_sample(task.scenario, trajectory, fall_height=scoring.fall_height)
    carried = len(height) if decided is None else decided
    step = float(np.median(np.diff(trajectory.time_s))) if len(height) > 1 else 0.0
    time_above = carried * step
    too_high = bool(height[0] > scoring.max_start_height)
    lasted = time_above >= scoring.min_time_s - 1e-9 and not too_high
    span = measure_span(task.scenario, trajectory, decided)
    spans = span is None or span.spans
    load = float(trajectory.cargo_mass[-1 if decided is None else decided])
    success = lasted and spans
    flags = {
        "start_too_high": too_high,
        "does_not_span": lasted and not spans,
        "never_fell": success and decided is None,
        "span_not_measured": trajectory.bearing is None
        and terrain_sides(task.scenario) is not None,
    }
    first = trajectory.breaks[0] if trajectory.breaks else None
    metrics: dict[str, Metric] = {
        "time_above_s": rounded(time_above),
        "lowest_cargo_height": rounded(height.min()),
        "start_height": rounded(height[0]),
        "fall_time_s": None if decided is None else rounded(trajectory.time_s[decided]),
        "load_when_decided": rounded(load),
        "load_at_first_break": first.cargo_mass if first else None,
        "broken_joints": len(trajectory.breaks),
        **_span_metrics(span),
    }
    return Verdict(
        success=success,
        indicator=rounded(load) if success else 0.0,
        metrics=metrics,
        flags=tuple(flag for flag, holds in flags.items() if holds),
        deciding=Deciding(
            samples=len(height) if decided is None else decided + 1,
            members=_largest_piece(machine, trajectory),
            cargo=True,
        ),
    )


def decision(task: "Task") -> Callable[[NDArray[np.float32] | None], bool]:
    """Tells the sample after which nothing changes success, indicator and flags.

    Args:
        task: Fall height and gap.

    Returns:
        Whether the cargo at a position is lost, as `judge` reads it.
    """
    scoring, scenario = task.scoring, task.scenario
    assert isinstance(scoring, SupportScoring)  # noqa: S101 - the scorer is chosen by it

    def decided(cargo: NDArray[np.float32] | None) -> bool:
        return cargo is not None and bool(
            is_lost(scenario, cargo[None], fall_height=scoring.fall_height)[0]
        )

    return decided


def _span_metrics(span: Span | None) -> dict[str, Metric]:
    if span is None:
        return dict.fromkeys(
            ("floor_share", "floor_growth", "least_terrain_share", "least_growth", "carried_share")
        )
    return {
        "floor_share": rounded(span.floor),
        "floor_growth": rounded(span.floor_growth),
        "least_terrain_share": rounded(span.least_terrain),
        "least_growth": rounded(span.least_growth),
        "carried_share": rounded(span.carried),
    }


def _largest_piece(machine: "Machine", trajectory: "Trajectory") -> Mask:
    """(T, N) the blocks of the heaviest piece: debris decides nothing."""
    pieces = trajectory.pieces
    if pieces is None or not pieces.shape[1]:
        return np.ones(trajectory.positions.shape[:2], dtype=bool)
    masses = np.array([machine.blocks[block].module.mass for block in trajectory.block_ids])
    largest = np.zeros(pieces.shape, dtype=bool)
    for first, last in spans_of(pieces):
        labels, of = np.unique(pieces[first], return_inverse=True)
        largest[first:last] = pieces[first] == labels[np.bincount(of, masses).argmax()]
    return largest
