"""Orbit: how fast a machine flies round a planet, and how near to its start it comes down again."""

import math
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import CAME_APART
from buildarena_benchmark.scoring.measures.carrying import from_below
from buildarena_benchmark.scoring.measures.masses import masses_of_blocks
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series
from buildarena_benchmark.scoring.scorer import (
    Deciding,
    Metric,
    Score,
    Scorer,
    Verdict,
    rounded,
    undriven,
)
from buildarena_benchmark.tasks.space.orbits import swept
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ

_NEAR: Final = 2.0
"""A machine comes down once a block's centre is so near the ground, units: a large tank's half."""

_BORNE: Final = 0.5
"""Smallest share of its weight without fuel on the ground for a machine to have landed."""

_RESTS: Final = 5
"""Samples over which it is judged whether a machine is at rest."""


class Return(Document):
    """Requirements on a machine's landing.

    Attributes:
        max_speed: Largest speed from when it is near the ground on, units/s.
        hold_s: Time after that for which it is judged, seconds.
        rest_speed: Largest speed at the end of that time, units/s.
        max_distance: Largest distance from the start, along the ground, units.
    """

    max_speed: Threshold = 6.0
    hold_s: Annotated[float, Field(ge=1, le=60)] = 4.0
    rest_speed: Threshold = 0.2
    max_distance: Threshold = 30.0


class OrbitScoring(Document):
    """Scoring of how often a machine flies round a planet.

    Attributes:
        least_height: Height of the starting block above the ground from which its way round counts,
            until it is lower again, units.
        landing: Rules for the landing after that; None where there need be none.
    """

    name: Literal["orbit"]
    cycles: Annotated[float, Field(gt=0, le=100)] = 3.0
    least_height: Threshold = 20.0
    landing: Return | None = None


def infeasible(scoring: OrbitScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scenario.planet is None:
        return "an orbit is judged, but scenario.planet is missing"
    if scoring.landing is not None and scoring.landing.hold_s >= scenario.duration_s:
        return f"landing.hold_s {scoring.landing.hold_s:g} is longer than the trial"
    return undriven(scenario)


def judge(scoring: OrbitScoring, run: Run) -> Verdict:
    """Measure cycles a minute, from the start until all are flown, or until it lands.

    The starting block's way round the planet's centre counts, about the axis about which it turns
    most, from when it has risen to the least height for the first time until it is lower again.
    Where the machine must come back, time runs until it lands. A trial that fails has 0.

    Flags:
        `came_apart`: it would have passed, but lost parts while it landed. `forces_not_measured`:
        cannot be judged.
    """
    planet = run.scenario.planet
    assert planet is not None  # noqa: S101 - `infeasible` looked
    start = run.start
    center = np.array([0.0, 0.0, -planet.radius])
    arms = run.positions - center
    heights = np.linalg.norm(arms, axis=2) - planet.radius
    first, last = _flight(heights[:, start], scoring.least_height)
    angle = swept(arms[first:last, start], np.zeros(3))
    rounds = np.abs(angle) / (2.0 * math.pi)
    done = np.flatnonzero(rounds >= scoring.cycles)
    metrics: dict[str, Metric] = {
        "cycles": rounded(rounds.max(initial=0.0)),
        "greatest_height": rounded(heights[:, start].max()),
        "least_height": rounded(heights[first:last, start].min(initial=np.inf))
        if first < last
        else None,
        "broken_joints": len(run.trajectory.breaks),
    }
    if not len(done):
        return Verdict(success=False, indicator=0.0, metrics=metrics)
    passed = first + int(done[0])
    lasted_s = float(run.time_s[passed])
    metrics["completed_s"] = rounded(lasted_s)
    if scoring.landing is None:
        return Verdict(
            success=True,
            indicator=rounded(60.0 * scoring.cycles / lasted_s),
            metrics=metrics,
            deciding=Deciding(samples=passed + 1, members=run.joined, cargo=False),
        )
    verdict = _judge_landing(scoring.landing, run, planet.radius, arms, passed)
    return Verdict(
        success=verdict.success,
        indicator=rounded(scoring.cycles * verdict.indicator),
        metrics={**metrics, **verdict.metrics},
        flags=verdict.flags,
        deciding=verdict.deciding,
    )


def _flight(height: Series, min_height: float) -> tuple[int, int]:
    """Return the first sample at which a block is high enough, and the next at which it is not."""
    high = height >= min_height
    if not high.any():
        return 0, 0
    first = int(high.argmax())
    low = np.flatnonzero(~high[first:])
    return first, first + int(low[0]) if len(low) else len(height)


def _judge_landing(rules: Return, run: Run, radius: float, arms: Series, passed: int) -> Verdict:
    """Return how a machine came down after its flight; the indicator is flights a minute.

    Args:
        radius: The planet's, units.
        arms: (T, N, 3) of the blocks, from the planet's centre, units.
        passed: Sample from which on the machine may land.
    """
    joined, start = run.joined, run.start
    low = np.where(joined, np.linalg.norm(arms, axis=2) - radius, np.inf).min(axis=1)
    down = np.flatnonzero(low[passed:] < _NEAR)
    end = (
        len(low) if not len(down) else passed + int(down[0]) + round(rules.hold_s * SAMPLE_RATE_HZ)
    )
    if end >= len(low):
        return Verdict(success=False, indicator=0.0, metrics={"landed": bool(len(down))})
    touch = passed + int(down[0])
    steps = np.linalg.norm(np.diff(arms[touch - 1 : end + 1, start], axis=0), axis=1)
    fastest = float(steps.max()) * SAMPLE_RATE_HZ
    last = arms[end, start] - arms[end - _RESTS, start]
    speed = float(np.linalg.norm(last)) * SAMPLE_RATE_HZ / _RESTS
    cosine = arms[end, start] @ arms[0, start]
    cosine /= np.linalg.norm(arms[end, start]) * np.linalg.norm(arms[0, start])
    away = radius * float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    dry = float((_dry_masses(run) * joined[end]).sum())
    landed = (
        fastest < rules.max_speed
        and speed < rules.rest_speed
        and away < rules.max_distance
        and float(from_below(run)[end]) > _BORNE * dry
    )
    intact = bool((joined[end] == joined[touch]).all())
    success = landed and intact
    return Verdict(
        success=success,
        indicator=60.0 / float(run.time_s[touch]) if success else 0.0,
        metrics={
            "landed": True,
            "landing_s": rounded(run.time_s[touch]),
            "speed_at_landing": rounded(fastest),
            "distance_to_start": rounded(away),
        },
        flags=(CAME_APART,) if landed and not intact else (),
        deciding=Deciding(samples=end + 1, members=joined, cargo=False),
    )


def _dry_masses(run: Run) -> Series:
    """Return the mass of each tracked block without fuel, (N,), mass units."""
    modules = [run.machine.blocks[block].module for block in run.trajectory.block_ids]
    fuel = np.array([module.tank.mass if module.tank else 0.0 for module in modules])
    return np.asarray(masses_of_blocks(run) - fuel)


def explain(scoring: OrbitScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if metrics.get("cycles", 0.0) < scoring.cycles:
        return f"It flew {metrics.get('cycles', 0.0):.2f} times round; {scoring.cycles:g} is asked."
    flew, rules = f"It flew round in {metrics['completed_s']:.1f} s", scoring.landing
    if score.success:
        away = metrics.get("distance_to_start")
        return f"{flew}." if away is None else f"{flew} and landed {away:.1f} from its start."
    if rules is None or "speed_at_landing" not in metrics:
        return f"{flew}, but had not landed for long enough at {scenario.duration_s:g} s."
    return (
        f"{flew} and came down at {metrics['speed_at_landing']:.1f} units/s, "
        f"{metrics['distance_to_start']:.1f} from its start; less than {rules.max_speed:g} units/s "
        f"and {rules.max_distance:g} are asked."
    )


SCORER: Final = Scorer(
    parameters=OrbitScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(CAME_APART,),
)
