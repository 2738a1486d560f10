"""Winch: how high a cargo is raised, and held when no key is pressed."""

from typing import Annotated, Final, Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scorers.measures.carrying import bears_cargo, stands
from buildarena_benchmark.scorers.measures.commands import motor_presses, presses_of
from buildarena_benchmark.scorers.measures.components import Mask, joined_to_start
from buildarena_benchmark.scorers.measures.gears import gear_turn_deg
from buildarena_benchmark.scorers.measures.series import Series
from buildarena_benchmark.scorers.measures.unmeasured import unmeasured
from buildarena_benchmark.scorers.scorer import (
    CAME_APART,
    FORCES_NOT_MEASURED,
    NOT_CARRIED,
    Deciding,
    Flag,
    Metric,
    Scorer,
    Verdict,
    rounded,
    undriven,
)
from buildarena_geometry import Machine
from buildarena_simulation import Scenario, Trajectory
from buildarena_simulation.constants import SAMPLE_RATE_HZ

NOT_STANDING: Final = Flag(
    name="not_standing",
    meaning="The ground did not bear machine and cargo while the cargo was held.",
)


NOT_GEARED: Final = Flag(
    name="not_geared",
    meaning="The cargo rose before a motor was told to turn, or not through a gear wheel that one "
    "turned.",
)


class WinchScoring(Document):
    """How high a cargo is raised and held when no key is pressed any more.

    Attributes:
        min_rise: The height held, above where the cargo stood, must be no less, units.
        hold_s: For how long it must be held, seconds.
        max_play: How far the height may vary meanwhile, up or down, units.
        max_early_rise: The cargo stays lower until the first key of a motor is pressed, units.
        min_gear_turn_deg: How far a large gear wheel must turn while the cargo rises, degrees.
    """

    name: Literal["winch"]
    min_rise: Threshold = 5.0
    hold_s: Annotated[float, Field(gt=0, le=600)] = 5.0
    max_play: Threshold = 0.3
    max_early_rise: Threshold = 0.3
    min_gear_turn_deg: Annotated[float, Field(gt=0, le=180)] = 20.0


def infeasible(scoring: WinchScoring, scenario: Scenario) -> str | None:
    """Why no machine can pass; see `Scorer`."""
    if scenario.cargo is None or scenario.cargo.at is None:
        return "the cargo is raised from its place, but scenario.cargo has no place: give cargo.at"
    end_s = scenario.control.until_s
    if end_s is None or end_s + scoring.hold_s > scenario.duration_s:
        return (
            f"the cargo is held for {scoring.hold_s:g} s without keys: scenario.control.until_s "
            "must be as long before the trial's end"
        )
    return undriven(scenario)


def judge(
    scoring: WinchScoring, scenario: Scenario, machine: "Machine", trajectory: "Trajectory"
) -> Verdict:
    """The indicator is the height held, times the cargo's mass.

    The height is the least of the cargo's heights above where it stood, over the best stretch of
    time after all keys were released in which it varies little, the machine is whole, bears the
    cargo, and stands on the ground with it. It counts if the cargo stayed down until a motor was
    told to turn, and rose through a gear wheel that motors turned; see `gear_turn_deg`.

    Args:
        scoring: Thresholds.
        scenario: What the machine was put through.
        machine: The machine.
        trajectory: The trial.

    Flags:
        `not_carried`: high enough for long enough, but not by the machine. `not_standing`: the
        ground did not bear machine and cargo. `came_apart`: parts came off. `not_geared`: it was
        not raised by gears. `forces_not_measured`: cannot be judged.
    """
    lacking = unmeasured(trajectory, cargo=True)
    if lacking is not None:
        return lacking
    assert trajectory.cargo_position is not None  # noqa: S101 - it was looked at
    assert trajectory.cargo_mass is not None  # noqa: S101
    joined = joined_to_start(machine, trajectory)
    height = trajectory.cargo_position[:, 2].astype(np.float64)
    height -= height[0]
    free = trajectory.time_s >= (scenario.control.until_s or 0.0)
    first_s, turn = _gearing(machine, trajectory, height)
    early = height[trajectory.time_s < first_s].max(initial=0.0)
    geared = early < scoring.max_early_rise and (turn or 0.0) >= scoring.min_gear_turn_deg
    rules: dict[Flag, Mask] = {
        NOT_GEARED: np.full(len(height), geared),
        NOT_CARRIED: bears_cargo(trajectory, share=0.8),
        NOT_STANDING: stands(machine, trajectory, joined),
        CAME_APART: np.asarray(joined.all(axis=1)),
    }
    held = _held(scoring, height, free & np.all(list(rules.values()), axis=0))
    passes = held >= scoring.min_rise
    flags = [
        flag
        for flag in rules
        if not passes and _held_but_for(scoring, height, free, rules, flag) >= scoring.min_rise
    ]
    metrics: dict[str, Metric] = {
        "held_height": rounded(held),
        "max_height": rounded(height.max(initial=0.0)),
        "early_rise": rounded(early),
        "gear_turn": None if turn is None else rounded(turn),
        "broken_joints": len(trajectory.breaks),
    }
    return Verdict(
        success=passes,
        indicator=rounded(held * float(trajectory.cargo_mass[-1])),
        metrics=metrics,
        flags=tuple(flags),
        deciding=Deciding(samples=len(height), members=joined, cargo=True),
    )


def _gearing(
    machine: "Machine", trajectory: "Trajectory", height: "Series"
) -> tuple[float, float | None]:
    """When the first key of a motor is pressed, seconds, and the turning from then on, degrees.

    It is that of a gear wheel, until the cargo is highest; without one, never and None.
    """
    presses = motor_presses(machine, presses_of(machine, trajectory))
    first_s = min((press.time_s for played in presses.values() for press in played), default=np.inf)
    first, last = int(np.searchsorted(trajectory.time_s, first_s)), int(height.argmax())
    if first >= last:
        return first_s, None
    return first_s, gear_turn_deg(machine, trajectory, presses, first=first, last=last)


def _held(scoring: WinchScoring, height: "Series", counts: "Mask") -> float:
    """The greatest height that is held, units; 0 if none is."""
    length = round(scoring.hold_s * SAMPLE_RATE_HZ) + 1
    if length > len(height):
        return 0.0
    windows = sliding_window_view(height, length)
    low = windows.min(axis=1)
    steady = windows.max(axis=1) - low <= 2.0 * scoring.max_play
    whole = sliding_window_view(counts, length).all(axis=1)
    return float(low.max(initial=0.0, where=steady & whole))


def _held_but_for(
    scoring: WinchScoring, height: "Series", free: "Mask", rules: dict[Flag, "Mask"], without: Flag
) -> float:
    """What would be held if it were not for one of the rules."""
    others = [mask for other, mask in rules.items() if other != without]
    return _held(scoring, height, free & np.all(others, axis=0))


SCORER: Final = Scorer(
    parameters=WinchScoring,
    judge=judge,
    infeasible=infeasible,
    flags=(NOT_CARRIED, NOT_STANDING, CAME_APART, NOT_GEARED, FORCES_NOT_MEASURED),
)
