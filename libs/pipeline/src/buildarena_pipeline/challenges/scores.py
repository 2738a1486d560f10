"""Scores of packages: each term by itself, and what is not known said instead of guessed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from buildarena_benchmark.scorers.measures.orbits import swept
from buildarena_besiege.logs.tracker_file import TrackerFile
from buildarena_pipeline.challenges.season import OrbitScore, Track, TrialsScore

FULL: Final = 100.0
"""Points of a perfect performance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """A part of a score.

    Attributes:
        name: What it is for.
        points: What it gives at most.
        share: How much of them was reached, 0 to 1; None where something is not known.
        sentence: The figures that it is made of.
    """

    name: str
    points: float
    share: float | None
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PackageScore:
    """The score of a package.

    Attributes:
        terms: Its parts.
        performance: Their sum; None where one is not known.
        known: The sum of those that are known: packages are ranked by it where not all are.
        at_most: What it can be at most.
        final: The performance times the track's coefficient, less what cost takes; None where
            something is not known.
        cost: Of the machine.
        unknown: What would have to be stated to know the rest.
    """

    terms: tuple[Term, ...]
    performance: float | None
    known: float
    at_most: float
    final: float | None
    cost: int
    unknown: tuple[str, ...]

    @property
    def points(self) -> float:
        """By which packages are ranked: the final score, or what of it is known."""
        return round(self.known if self.final is None else self.final, 9)


def score_flight(
    flight: TrackerFile, rule: OrbitScore, track: Track, *, cost: int, track_name: str
) -> PackageScore:
    """The score of a flight.

    Args:
        flight: The flight.
        rule: The season's formula.
        track: Whose coefficient counts.
        cost: Of the machine.
        track_name: What messages call the track.
    """
    angle = (
        None
        if rule.center is None
        else float(abs(swept(flight.position, np.array(rule.center))[-1]))
    )
    lasted = float(flight.time_s[-1] - flight.time_s[0])
    terms = (
        _progress(rule, angle),
        _speed(rule, angle, lasted),
        _integrity(rule, float(flight.integrity[-1])),
    )
    return summed(terms, rule, track, cost=cost, track_name=track_name)


def summed(
    terms: Sequence[Term],
    rule: OrbitScore | TrialsScore,
    track: Track,
    *,
    cost: int,
    track_name: str,
) -> PackageScore:
    """The score of all terms; see `score_flight`."""
    known = sum(term.points * term.share for term in terms if term.share is not None)
    missing = sum(term.points for term in terms if term.share is None)
    performance = None if missing else known
    final = None
    if performance is not None and track.coefficient is not None and rule.cost_penalty is not None:
        final = max(0.0, performance * track.coefficient - rule.cost_penalty * cost)
    return PackageScore(
        terms=tuple(terms),
        performance=performance,
        known=known,
        at_most=known + missing,
        final=final,
        cost=cost,
        unknown=_unknown(rule, track, track_name),
    )


def ranks_of(points: Sequence[float]) -> list[int]:
    """The rank of each score, 1 for the greatest; equal scores share the better one."""
    first: dict[float, int] = {}
    for place, own in enumerate(sorted(points, reverse=True), start=1):
        first.setdefault(own, place)
    return [first[own] for own in points]


def _progress(rule: OrbitScore, angle: float | None) -> Term:
    points = FULL * rule.progress
    if angle is None:
        return Term(
            name="progress", points=points, share=None, sentence="the planet's centre is not known"
        )
    cycles = angle / (2 * math.pi)
    share = min(1.0, cycles / rule.cycles)
    sentence = f"{cycles:.3f} cycles of {rule.cycles:g}"
    return Term(name="progress", points=points, share=share, sentence=sentence)


def _speed(rule: OrbitScore, angle: float | None, lasted_s: float) -> Term:
    points = FULL * rule.speed
    if angle is None:
        return Term(
            name="speed", points=points, share=None, sentence="the planet's centre is not known"
        )
    omega = angle / lasted_s if lasted_s > 0 else 0.0
    said = f"{omega:.4f} rad/s over {lasted_s:.2f} s"
    if rule.omega_ref is None:
        return Term(
            name="speed", points=points, share=None, sentence=f"{said}; its reference is not known"
        )
    share = min(1.0, omega / rule.omega_ref)
    return Term(name="speed", points=points, share=share, sentence=f"{said}, of {rule.omega_ref:g}")


def _integrity(rule: OrbitScore, share: float) -> Term:
    points = FULL * rule.integrity
    return Term(
        name="integrity", points=points, share=share, sentence=f"{100 * share:.1f} % is whole"
    )


def _unknown(rule: OrbitScore | TrialsScore, track: Track, track_name: str) -> tuple[str, ...]:
    missing = [name for name, value in rule.model_dump().items() if value is None]
    if track.coefficient is None:
        missing.append(f"coefficient.{track_name}")
    return tuple(missing)
