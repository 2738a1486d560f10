"""Budget: how light a bridge is that carries the stated load to the end."""

from typing import Final, Literal

import numpy as np

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring import support
from buildarena_benchmark.scoring.flags import START_TOO_HIGH, Flag
from buildarena_benchmark.scoring.measures.outline import extents
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, raised, rounded
from buildarena_simulation import Scenario
from buildarena_simulation.trial import Decision

NO_DECK: Final = Flag(
    name="no_deck",
    meaning="The blocks below the cargo have gaps: no deck as long as the cargo carries it.",
)
_GAP: Final = 0.05
"""Blocks farther apart do not make one deck, units."""


class BudgetScoring(Document):
    """Scoring of how little mass carries the scenario's cargo over a gap.

    Attributes:
        fall_height: Height of the cargo's centre below which it has fallen, units.
        max_start_height: Largest start height, units.
    """

    name: Literal["budget"]
    fall_height: Threshold = 4.0
    max_start_height: Threshold = 20.0


def infeasible(scoring: BudgetScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    cargo = scenario.cargo
    if cargo is not None and cargo.ramp_start_s + cargo.ramp_s >= scenario.duration_s:
        return f"the cargo weighs its {cargo.final_mass:g} only when the trial has ended"
    return support.infeasible(_as_support(scoring, scenario), scenario)


def judge(scoring: BudgetScoring, run: Run) -> Verdict:
    """Measure the stated load over the machine's mass, where that load is carried.

    The stated load is the cargo's final mass. The trial succeeds if a bridge carries it to the end
    of the trial, as `support` reads it up to that moment. A machine that carries less of it, or
    not so long, has an indicator of 0, and one that could carry more has no more of it. The mass
    is that of all blocks and connectors that were built, whatever comes off. At the start, blocks
    below the cargo must be as long as it is in one row along the gap's width, without gaps.

    A run without a cargo fails.

    Flags:
        `does_not_span`: the load did not go to both terrains. `start_too_high`: the cargo started
        above the limit. `no_deck`: the row of blocks is shorter. `span_not_measured`: no contact
        forces are known. As of `support`, whose further one is left out: more load would earn
        nothing, so the indicator is not a lower bound.
    """
    bridge = support.judge(_as_support(scoring, run.scenario), run)
    carries = bridge.success and support.NEVER_FELL in bridge.flags
    success = carries and _has_deck(run)
    stated = run.scenario.cargo.final_mass if run.scenario.cargo else 0.0
    return Verdict(
        success=success,
        indicator=rounded(stated / run.machine.mass) if success else 0.0,
        metrics=bridge.metrics,
        flags=(
            *(flag for flag in bridge.flags if flag is not support.NEVER_FELL),
            *raised({NO_DECK: carries and not success}),
        ),
        deciding=bridge.deciding,
    )


def decision(scoring: BudgetScoring, scenario: Scenario) -> Decision:
    """Return a test for the sample after which nothing changes, see `Scorer`: the cargo is lost."""
    return support.decision(_as_support(scoring, scenario), scenario)


def _has_deck(run: Run) -> bool:
    """Return whether blocks below the cargo reach along its length in one row at the start."""
    (west, east), (south, north) = (extents(run, axis=axis) for axis in (0, 1))
    width, length = run.cargo_size[:2]
    middle = run.cargo_path[0]
    below = (east[0] > middle[0] - width / 2) & (west[0] < middle[0] + width / 2)
    begin = end = -np.inf
    for low, high in sorted(zip(south[0][below], north[0][below], strict=True)):
        begin, end = (low, high) if low > end + _GAP else (begin, max(end, high))
        if end - begin >= length - _GAP and begin < middle[1] < end:
            return True
    return False


def _as_support(scoring: BudgetScoring, scenario: Scenario) -> support.SupportScoring:
    cargo = scenario.cargo
    return support.SupportScoring(
        name="support",
        fall_height=scoring.fall_height,
        min_time_s=cargo.ramp_start_s + cargo.ramp_s if cargo else 0.0,
        max_start_height=scoring.max_start_height,
    )


def explain(scoring: BudgetScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics, load = score.metrics, score.metrics.get("load_when_decided")
    if load is None:
        return "There was no cargo to carry."
    if score.success:
        return f"The bridge carried {load:,.0f} to the end with a mass of {metrics['mass']:.2f}."
    if metrics.get("fall_time_s") is None and metrics.get("collapse_time_s") is None:
        return f"The cargo stayed up to the end, with a load of {load:,.0f}."
    final = scenario.cargo.final_mass if scenario.cargo else 0.0
    return f"The bridge gave way at a load of {load:,.0f} of {final:,.0f}: nothing is earned."


SCORER: Final = Scorer(
    parameters=BudgetScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="places",
    flags=(support.DOES_NOT_SPAN, START_TOO_HIGH, NO_DECK, support.SPAN_NOT_MEASURED),
    decision=decision,
)
