"""Haul: how heavy a cargo, which grows heavier, is when a machine raises it."""

from collections.abc import Iterable, Iterator
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import CAME_APART, NOT_AIRBORNE, NOT_CARRIED, Flag
from buildarena_benchmark.scoring.measures.carrying import bears_cargo, is_airborne, rests
from buildarena_benchmark.scoring.measures.commands import motor_presses
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.gears import gear_turn_deg
from buildarena_benchmark.scoring.measures.masses import masses_of_blocks
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, final_mass, judged, undriven
from buildarena_simulation import Scenario

NOT_STANDING: Final = Flag(
    name="not_standing",
    meaning="The ground did not bear machine and cargo while the cargo was held.",
)
NOT_GEARED: Final = Flag(
    name="not_geared",
    meaning="The cargo rose before a motor was told to turn, not through a gear wheel that one "
    "turned, or by the machine's own sinking weight alone.",
)

_SETTLED: Final = 13
"""Samples after its start until forces summed over half a second are those of the lift."""

_SHARE: Final = 0.5
"""Smallest share of a weight that counts as carried: a lift by a swing presses less for a while."""


_DRIVEN: Final = 0.8
"""Smallest share of a lift by gears during which a motor is commanded to turn."""


class HaulScoring(Document):
    """Scoring of how heavy a cargo is raised.

    Attributes:
        by: "gears": the machine is on the ground, and a large gear wheel that motors turn lies
            between it and the cargo; "flight": it is in the air.
        min_rise: Least height of the cargo above its place at the start, units.
        start_rise: The lift begins when it was last lower than that above its place, units.
        min_gear_turn_deg: Least angle by which a large gear wheel turns in the lift, degrees.
    """

    name: Literal["haul"]
    by: Literal["gears", "flight"]
    min_rise: Threshold = 5.0
    start_rise: Annotated[float, Field(gt=0, le=100)] = 0.5
    min_gear_turn_deg: Annotated[float, Field(gt=0, le=180)] = 20.0


def infeasible(scoring: HaulScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scenario.cargo is None or scenario.cargo.at is None:
        return "the cargo is raised from its place, but scenario.cargo has none: give cargo.at"
    if scoring.start_rise >= scoring.min_rise:
        return f"start_rise {scoring.start_rise:g} is not below min_rise {scoring.min_rise:g}"
    return undriven(scenario)


def judge(scoring: HaulScoring, run: Run) -> Verdict:
    """Measure the cargo's mass at the beginning of a lift, the greatest of all lifts.

    A lift lasts from when the cargo was last near its place until it is high enough. During it,
    except for its first half second, the machine must carry it, be whole, and be on the ground or
    in the air, as the task requires.

    Flags:
        `not_carried`: it got high enough, but not on the machine. `came_apart`: parts came
        off. `not_standing`: it is not on the ground. `not_geared`: it was not raised by gears.
        `not_airborne`: the machine is not in the air. `forces_not_measured`: cannot be judged.
    """
    height = run.cargo_path[:, 2] - run.cargo_path[0, 2]
    lifts = list(_lifts(scoring, height))
    rules: dict[Flag, list[bool]] = {
        NOT_CARRIED: _all_along(lifts, bears_cargo(run, share=_SHARE)),
        CAME_APART: _all_along(lifts, np.asarray(run.joined.all(axis=1))),
    }
    if scoring.by == "gears":
        rules[NOT_STANDING] = _all_along(lifts, rests(run, share=_SHARE))
        rules[NOT_GEARED] = [_is_geared(scoring, run, *lift) for lift in lifts]
    else:
        rules[NOT_AIRBORNE] = _all_along(lifts, is_airborne(run))
    counts = np.all(list(rules.values()), axis=0)
    counted = [lift for lift, counting in zip(lifts, counts, strict=True) if counting]
    loads = [float(run.cargo_mass[begin]) for begin, _ in counted]
    decided = counted[int(np.argmax(loads))][1] + 1 if counted else len(height)
    return judged(
        run,
        success=bool(loads),
        indicator=max(loads, default=0.0),
        flags={flag: not loads and _alone(rules, flag) for flag in rules},
        metrics={
            "lifts": len(loads),
            "max_height": height.max(initial=0.0),
        },
        samples=decided,
        cargo=True,
    )


def _lifts(scoring: HaulScoring, height: "Series") -> "Iterator[tuple[int, int]]":
    """Yield each time the cargo gets high enough: when it was last low, and when it is there."""
    low = height < scoring.start_rise
    high = np.flatnonzero((height[1:] >= scoring.min_rise) & (height[:-1] < scoring.min_rise)) + 1
    for end in high:
        begin = int(np.flatnonzero(low[:end])[-1])
        if not (height[begin + 1 : end] >= scoring.min_rise).any():
            yield begin, int(end)


def _all_along(lifts: "Iterable[tuple[int, int]]", holds: Mask) -> list[bool]:
    """Return whether a rule holds throughout each lift that is long enough to judge."""
    return [
        begin + _SETTLED <= end and bool(holds[begin + _SETTLED : end + 1].all())
        for begin, end in lifts
    ]


def _is_geared(scoring: HaulScoring, run: Run, begin: int, end: int) -> bool:
    """Return whether motors that were commanded raised the cargo through a large gear wheel."""
    presses = motor_presses(run)
    played = [press for reached in presses.values() for press in reached]
    if run.time_s[begin] < min((press.time_s for press in played), default=np.inf):
        return False
    time_s = run.time_s[begin:end]
    turning = np.zeros(len(time_s), dtype=bool)
    for press in played:
        turning |= (time_s >= press.time_s) & (time_s < press.time_s + press.hold_for_s)
    if turning.mean() < _DRIVEN or _lifts_by_weight(run, begin, end):
        return False
    turn = gear_turn_deg(run, presses, first=begin, last=end)
    return (turn or 0.0) >= scoring.min_gear_turn_deg


def _lifts_by_weight(run: Run, begin: int, end: int) -> bool:
    """Return whether sinking parts gave what the cargo gained: no motor had to."""
    heights = run.positions[[begin, end], :, 2]
    lost = masses_of_blocks(run) @ (heights[0] - heights[1])
    low, high = run.cargo_path[[begin, end], 2]
    return bool(lost >= run.cargo_mass[begin] * (high - low))


def _alone(rules: dict[Flag, list[bool]], flag: Flag) -> bool:
    """Return whether some lift would have counted without one of the rules."""
    other_rules = [holds for other, holds in rules.items() if other != flag]
    return bool(np.all(other_rules, axis=0).any())


def explain(scoring: HaulScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    rose = score.metrics.get("max_height", 0.0)
    if score.success:
        return f"A cargo of {score.indicator:.2f} was raised by {scoring.min_rise:g}."
    asked = f"The cargo rose by {rose:.1f}; {scoring.min_rise:g} is asked"
    return f"{asked}." if rose < scoring.min_rise else f"{asked}, in a lift by all rules."


SCORER: Final = Scorer(
    parameters=HaulScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="cargo",
    flags=(NOT_CARRIED, CAME_APART, NOT_STANDING, NOT_GEARED, NOT_AIRBORNE),
    ceiling=final_mass,
)
