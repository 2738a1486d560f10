"""Support: how heavy a cargo a bridge carries before it falls into the gap."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import START_TOO_HIGH, Flag
from buildarena_benchmark.scoring.measures.components import Mask, spans_of
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.spanning import (
    Span,
    collapsed_sample,
    deciding_sample,
    is_lost,
    measure_span,
    terrain_sides,
)
from buildarena_benchmark.scoring.scorer import (
    Deciding,
    Metric,
    Score,
    Scorer,
    Verdict,
    final_mass,
    raised,
    rounded,
)
from buildarena_simulation import Scenario
from buildarena_simulation.recording import Moment
from buildarena_simulation.trial import Decision

DOES_NOT_SPAN: Final = Flag(
    name="does_not_span",
    meaning="The load did not go to both terrains: the gap's floor bore more than a tenth of it, "
    "or one terrain bore nothing.",
)
NEVER_FELL: Final = Flag(
    name="never_fell",
    meaning="The bridge carried everything there was: its load is at least the figure that is "
    "shown.",
    disqualifying=False,
    censoring=True,
)
SPAN_NOT_MEASURED: Final = Flag(
    name="span_not_measured",
    meaning="The trial has no contact forces, so whether the bridge spans was not measured.",
    disqualifying=False,
)


class SupportScoring(Document):
    """Scoring of how heavy a cargo is carried over a gap.

    Attributes:
        fall_height: Height of the cargo's centre below which it has fallen, units.
        min_time_s: Least total time at or above that height.
        max_start_height: Largest start height, units.
        per_mass: Whether the load over the machine's mass is a metric.
    """

    name: Literal["support"]
    fall_height: Threshold = 4.0
    min_time_s: Threshold = 2.0
    max_start_height: Threshold = 20.0
    per_mass: Annotated[bool, Field(exclude_if=lambda value: not value)] = False


def infeasible(scoring: SupportScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scenario.cargo is None:
        return "the cargo is judged, but scenario has no cargo"
    if scoring.min_time_s > scenario.duration_s:
        return f"min_time_s {scoring.min_time_s:g} is longer than the trial"
    return None


def judge(scoring: SupportScoring, run: Run) -> Verdict:
    """Measure the cargo's mass when a bridge first does not carry it over the gap.

    That is when its centre sinks below the fall height or comes too far from the gap's middle, or
    when no part in one piece reaches from terrain to terrain any more; it is the final mass if
    that never happens. The trial succeeds if the cargo was carried for some time
    in all, did not start too high, and the load went to both terrains until then; the indicator is
    0 otherwise.

    A run without a cargo fails.

    Flags:
        `start_too_high`: the cargo started above the limit. `does_not_span`: the load did not go
        to both terrains; see `Span`. `never_fell`: everything was carried, so the indicator is
        only a lower bound. `span_not_measured`: no contact forces are known.

    Source: the paper, section "Evaluation"; thresholds as in the published evaluation.
    """
    if run.trajectory.cargo_position is None or run.trajectory.cargo_mass is None:
        return Verdict(success=False, indicator=0.0)
    height = run.cargo_path[:, 2]
    fell = deciding_sample(run, fall_height=scoring.fall_height)
    collapsed = collapsed_sample(run)
    decided = min((sample for sample in (fell, collapsed) if sample is not None), default=None)
    carried = len(height) if decided is None else decided
    step = float(np.median(np.diff(run.time_s))) if len(height) > 1 else 0.0
    time_above = carried * step
    too_high = bool(height[0] > scoring.max_start_height)
    lasted = time_above >= scoring.min_time_s - 1e-9 and not too_high
    span = measure_span(run, decided)
    spans = span is None or span.spans
    load = float(run.cargo_mass[-1 if decided is None else decided])
    success = lasted and spans
    flags = {
        START_TOO_HIGH: too_high,
        DOES_NOT_SPAN: lasted and not spans,
        NEVER_FELL: success and decided is None,
        SPAN_NOT_MEASURED: run.trajectory.bearing is None
        and terrain_sides(run.scenario) is not None,
    }
    ends_s = float(run.time_s[-1 if decided is None else decided])
    breaks = [event for event in run.trajectory.breaks if event.time_s <= ends_s]
    metrics: dict[str, Metric] = {
        "time_above_s": rounded(time_above),
        "start_height": rounded(height[0]),
        "fall_time_s": None if fell is None else rounded(run.time_s[fell]),
        "collapse_time_s": None if collapsed is None else rounded(run.time_s[collapsed]),
        "load_when_decided": rounded(load),
        "load_on_debris": None
        if collapsed is None
        else rounded(run.cargo_mass[-1 if fell is None else fell]),
        "load_at_first_break": breaks[0].cargo_mass if breaks else None,
        "broken_joints": len(breaks),
        **_span_metrics(span),
    }
    if scoring.per_mass:
        metrics["load_per_mass"] = rounded(load / run.machine.mass) if success else 0.0
    return Verdict(
        success=success,
        indicator=rounded(load) if success else 0.0,
        metrics=metrics,
        flags=raised(flags),
        deciding=Deciding(
            samples=len(height) if decided is None else decided + 1,
            members=_largest_piece(run),
            cargo=True,
        ),
    )


def decision(scoring: SupportScoring, scenario: Scenario) -> Decision:
    """Return a test for the sample after which nothing changes success, indicator and flags.

    Returns:
        Whether the cargo is lost, as `judge` reads it; a bridge may have collapsed before.
    """

    def decided(moment: Moment) -> bool:
        cargo = moment.cargo
        return cargo is not None and bool(
            is_lost(scenario, cargo[None], fall_height=scoring.fall_height)[0]
        )

    return decided


def _span_metrics(span: Span | None) -> dict[str, Metric]:
    fields = {
        "floor_share": "floor",
        "floor_growth": "floor_growth",
        "least_terrain_share": "least_terrain",
        "least_growth": "least_growth",
        "carried_share": "carried",
    }
    return {n: None if span is None else rounded(getattr(span, f)) for n, f in fields.items()}


def _largest_piece(run: Run) -> Mask:
    """Return the blocks of the heaviest piece, (T, N): debris decides nothing."""
    pieces = run.trajectory.pieces
    if pieces is None or not pieces.shape[1]:
        return np.ones(run.trajectory.positions.shape[:2], dtype=bool)
    masses = run.block_masses
    largest = np.zeros(pieces.shape, dtype=bool)
    for first, last in spans_of(pieces):
        labels, of = np.unique(pieces[first], return_inverse=True)
        largest[first:last] = pieces[first] == labels[np.bincount(of, masses).argmax()]
    return largest


def explain(scoring: SupportScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics, final = score.metrics, final_mass(scoring, scenario) or 0.0
    load, fell, collapsed = (
        float(metrics[name]) if metrics.get(name) is not None else None
        for name in ("load_when_decided", "fall_time_s", "collapse_time_s")
    )
    if load is None:
        return "There was no cargo to carry."
    if fell is None and collapsed is None:
        return f"The bridge carried all {final:,.0f} to the end."
    broke = collapsed is not None and (fell is None or collapsed <= fell)
    ending = f"broke after {collapsed:.1f} s" if broke else f"lost its cargo after {fell:.1f} s"
    sentence = f"The bridge {ending}, at a load of {load:,.0f} of {final:,.0f}"
    if metrics["time_above_s"] < scoring.min_time_s:
        return f"{sentence}; it must hold for {scoring.min_time_s:g} s."
    return f"{sentence}."


SCORER: Final = Scorer(
    parameters=SupportScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="places",
    flags=(DOES_NOT_SPAN, START_TOO_HIGH, NEVER_FELL, SPAN_NOT_MEASURED),
    decision=decision,
    ceiling=final_mass,
)
