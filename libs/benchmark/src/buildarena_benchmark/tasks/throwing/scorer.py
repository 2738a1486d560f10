"""Throwing: how far, or how well through rings a boulder flies."""

from dataclasses import dataclass
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import BASE_MOVED, CAME_APART, START_TOO_HIGH, Flag
from buildarena_benchmark.scoring.measures.gates import ahead_of, gate_of, unknown_gate
from buildarena_benchmark.scoring.measures.marks import MarkName, mark_of, unusable_mark
from buildarena_benchmark.scoring.measures.outline import reaches
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, tilt_deg
from buildarena_benchmark.scoring.measures.thrown import (
    HELD,
    TOUCH,
    Flight,
    flight_of,
    gap_to_world,
    gaps_to_parts,
    loose_ball,
    radius_of,
)
from buildarena_benchmark.scoring.scorer import (
    Deciding,
    Metric,
    Score,
    Scorer,
    Verdict,
    raised,
    rounded,
    undriven,
)
from buildarena_benchmark.tasks.throwing.work_energy import most_work
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.scenario import GroundPlacement

_NEAR: Final = 0.3
"""Largest gap between the boulder and the machine that carries it, units: it rolls and settles."""

_INSIDE: Final = 0.1
"""Farther than this it may not begin inside a part, units: engines drive apart what overlaps."""

_SLACK: Final = 0.5
"""Height to which its own weight may be lifted by what no work explains, units."""

_LEAST_HEIGHT: Final = 3.0
"""Height above which the published score asks a boulder to rise, units."""

NOT_BORNE: Final = Flag(
    name="not_borne",
    meaning="The boulder flew far enough, but no machine that is joined to the starting block "
    "bore it for long enough before.",
)
CROSSED_LINE: Final = Flag(
    name="crossed_line",
    meaning="A part of the machine reached beyond the line before the boulder came down.",
)
THRUST_USED: Final = Flag(
    name="thrust_used", meaning="The machine has a part that pushes or lifts by itself."
)
NOT_FREE: Final = Flag(
    name="not_free",
    meaning="The boulder touched something on its way, or flew as no free ball does.",
)
UNEXPLAINED: Final = Flag(
    name="unexplained",
    meaning="The boulder had more energy than springs, drives and falling parts can have given it, "
    "or started inside a part.",
)


class ThrowScoring(Document):
    """Scoring of how far, or how well through rings, a boulder flies.

    Attributes:
        line: Name of the gate that is the line.
        min_distance: Least distance of the landing beyond the line, units.
        rings: Names of the marks that are rings, in order, upright and facing the line; what flies
            through one passes nearer to its middle than its radius less the boulder's.
        borne_s: Least time for which the machine must carry it before it flies, seconds.
        max_base_shift: Largest shift of the starting block until the boulder flies, units. Recoil
            on the machine afterwards does not count.
        max_tilt_deg: Largest lean of the starting block until then, degrees.
        max_start_height: Bound of the boulder's start height, units: its own fall does not count.
        max_error: Largest deviation of its flight from a free one, as a share of its way.
        max_unexplained: Largest excess of its energy over the work done, as a share.
    """

    name: Literal["throw"]
    line: MarkName = "line"
    min_distance: Threshold = 10.0
    rings: Annotated[tuple[MarkName, ...], Field(max_length=8, exclude_if=lambda v: not v)] = ()
    borne_s: Annotated[float, Field(gt=0, le=60)] = 1.0
    max_base_shift: Threshold = 3.0
    max_tilt_deg: Annotated[float, Field(gt=0, le=180)] = 30.0
    max_start_height: Threshold = 5.0
    max_error: Annotated[float, Field(gt=0, le=1)] = 0.03
    max_unexplained: Annotated[float, Field(ge=0, le=1)] = 0.05


def infeasible(scoring: ThrowScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    lacks = [unknown_gate(scoring.line, scenario)]
    lacks += [unusable_mark(name, scenario) for name in scoring.rings]
    lacking = next(filter(None, lacks), None)
    if lacking is not None:
        return lacking
    on_ground = isinstance(scenario.placement, GroundPlacement)
    reasons = {
        "a throw is from the ground, but scenario.placement.kind is not ground": not on_ground,
        "gusts and pushes would throw as well: a throw is judged without them": scenario.pushes
        or scenario.gusts is not None,
        "what a machine did to its boulder is known only if all blocks are tracked": (
            scenario.tracked_blocks != "all"
        ),
        f"borne_s {scoring.borne_s:g} is longer than the trial": (
            scoring.borne_s >= scenario.duration_s
        ),
    }
    return next((reason for reason, holds in reasons.items() if holds), undriven(scenario))


def judge(scoring: ThrowScoring, run: Run) -> Verdict:
    """Measure how far a boulder flies, or how well it passes rings.

    A ring that it passes untouched is worth 1, and up to 1 more the nearer to its middle.

    The boulder is the first loose ball of the machine. What counts is where it first touches
    ground or terrain, if the machine bore and threw it: 0 otherwise.

    Flags:
        `not_borne`: no machine that is joined to the starting block bore it before it flew.
        `crossed_line`: a part was beyond the line. `thrust_used`: a part pushes or lifts.
        `not_free`: it touched something on its way, or flew as no free ball does. `base_moved`:
        the starting block did not stay before. `came_apart`: a joint broke before it flew.
        `unexplained`: it has more energy than springs, drives and falling parts can have given.
        `start_too_high`: it started high up. `forces_not_measured`: cannot be judged.
    """
    ball = loose_ball(run.machine, run.trajectory)
    if ball is None:
        return Verdict(success=False, indicator=0.0, metrics={"flew": False})
    gaps = gaps_to_parts(run, ball)
    flight = flight_of(run, ball, gaps)
    if flight is None:
        touched = bool((gaps.min(axis=1) <= HELD).any())
        return Verdict(success=False, indicator=0.0, metrics={"flew": False, "touched": touched})
    throw = _Throw(
        scoring=scoring,
        run=run,
        ball=ball,
        gaps=gaps,
        flight=flight,
    )
    faults = throw.faults()
    distance = throw.distance()
    rings = [throw.nearness(name) for name in scoring.rings]
    reaches_goal = distance >= scoring.min_distance and all(nearness > 0.0 for nearness in rings)
    counts = not any(faults.values())
    worth = max(distance, 0.0)
    if rings:
        worth = sum(1.0 + nearness for nearness in rings if nearness > 0.0)
    members = run.joined.copy()
    members[:, ball] = True
    return Verdict(
        success=reaches_goal and counts,
        indicator=rounded(worth) if counts else 0.0,
        metrics=throw.metrics(),
        flags=raised({flag: reaches_goal and fault for flag, fault in faults.items()}),
        deciding=Deciding(samples=flight.landed + 1, members=members, cargo=False),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Throw:
    """A trial in which the boulder flew.

    Attributes:
        ball: Index of the boulder among the tracked blocks.
        gaps: (T, N) from its surface to each of them, units.
    """

    scoring: ThrowScoring
    run: Run
    ball: int
    gaps: Series
    flight: Flight

    def faults(self) -> dict[Flag, bool]:
        """Return the rules, and whether the throw breaks them."""
        scoring, trajectory = self.scoring, self.run.trajectory
        shift, lean = self._base()
        flies_s = trajectory.time_s[self.flight.released + 1]
        high = float(trajectory.positions[0, self.ball, 2]) >= scoring.max_start_height
        modules = [block.module for block in self.run.machine.blocks.values()]
        return {
            NOT_BORNE: not self._is_carried(),
            CROSSED_LINE: self._front() > 0.0,
            THRUST_USED: any(each.thrust or each.greatest_push or each.wing for each in modules),
            NOT_FREE: self.flight.error > scoring.max_error,
            BASE_MOVED: shift >= scoring.max_base_shift or lean >= scoring.max_tilt_deg,
            CAME_APART: any(event.time_s <= flies_s for event in trajectory.breaks),
            UNEXPLAINED: self._is_unexplained(),
            START_TOO_HIGH: high,
        }

    def metrics(self) -> dict[str, Metric]:
        """Return the secondary metrics."""
        gravity = self.run.scenario.gravity
        return {
            "flew": True,
            "distance": rounded(self.distance()),
            "rings": self._passed(),
            "parabola": rounded(self._parabola()),
            "release_s": rounded(self.run.trajectory.time_s[self.flight.released]),
            "release_speed": rounded(float(np.linalg.norm(self.flight.velocity))),
            "flight_error": rounded(self.flight.error),
            "energy": rounded(self._energy() / gravity),
            "work": rounded(self._work() / gravity),
            "base_shift": rounded(self._base()[0]),
            "broken_joints": len(self.run.trajectory.breaks),
        }

    def distance(self) -> float:
        """Return the distance of its landing beyond the line, units."""
        middle, ahead = self._line()
        return float((self.flight.end[:2] - middle) @ ahead)

    def nearness(self, ring: str) -> float:
        """Return its path's nearness to a ring's middle: 1 there, at most 0 outside."""
        mark, (_, ahead) = mark_of(ring, self.run.scenario), self._line()
        middle, room = np.array(mark.center), mark.radius - radius_of(self.run, self.ball)
        flown = slice(self.flight.released + 1, self.flight.landed)
        path = self.run.positions[flown, self.ball]
        along = (path[:, :2] - middle[:2]) @ ahead
        (before,) = np.nonzero((along[:-1] < 0.0) & (along[1:] >= 0.0))
        if not len(before):
            return 0.0
        first = int(before[0])
        share = -along[first] / (along[first + 1] - along[first])
        at = path[first] + share * (path[first + 1] - path[first])
        return 1.0 - float(np.linalg.norm(at - middle)) / room

    def _parabola(self) -> float:
        """Return BesiegeField's score: the distance from its start, times 1 + how far it rose.

        It is 0 where the boulder never rose above a height of 3, or comes down nearer to the
        starting block than a quarter of that distance. Source: its public release.
        """
        path = self.run.positions[: self.flight.landed + 1, self.ball]
        block = self.run.path[self.flight.landed]
        distance = float(np.linalg.norm(self.flight.end[:2] - path[0, :2]))
        block_distance = float(np.linalg.norm(self.flight.end - block))
        if path[:, 2].max() < _LEAST_HEIGHT or block_distance < distance / 4:
            return 0.0
        return distance * (1.0 + float(path[:, 2].max() - path[0, 2]))

    def _passed(self) -> int | None:
        """Return how many rings it passes; None without rings."""
        rings = self.scoring.rings
        return sum(self.nearness(name) > 0.0 for name in rings) if rings else None

    def _line(self) -> tuple[Series, Series]:
        """Return the line's middle (2,), and the direction (2,) in which it is crossed."""
        gate = gate_of(self.scoring.line, self.run.scenario)
        return np.array(gate.center), ahead_of(gate)

    def _front(self) -> float:
        """Return how far beyond the line any other part gets until the boulder lands, units."""
        middle, ahead = self._line()
        _, high = reaches(self.run, np.array([*ahead, 0.0]))
        other_parts = np.delete(high[: self.flight.landed + 1], self.ball, axis=1)
        return float(other_parts.max() - middle @ ahead)

    def _base(self) -> tuple[float, float]:
        """Return the starting block's shift, units, and lean, degrees, until the boulder flies."""
        until = self.flight.released + 2
        path, lean = self.run.path[:until], tilt_deg(self.run.trajectory, self.run.start)[:until]
        return float(np.linalg.norm(path - path[0], axis=1).max()), float(lean.max())

    def _mass(self) -> float:
        return self.run.machine.blocks[self.run.trajectory.block_ids[self.ball]].module.mass

    def _energy(self) -> float:
        """Return the energy given to the boulder until it flew, without its fall, mass·unit²/s²."""
        rise = float(self.flight.start[2]) - float(self.run.trajectory.positions[0, self.ball, 2])
        motion = float(self.flight.velocity @ self.flight.velocity) / 2
        return self._mass() * (motion + self.run.scenario.gravity * max(rise, 0.0))

    def _work(self) -> float:
        """Return the largest energy that the machine can have given it, mass·unit²/s²."""
        until = self.flight.released + 1
        return most_work(self.run, self.ball, until)

    def _is_unexplained(self) -> bool:
        spare = _SLACK * self.run.scenario.gravity * self._mass()
        limit = (1.0 + self.scoring.max_unexplained) * self._work() + spare
        return self._energy() > limit or bool(self.gaps[0].min() < -_INSIDE)

    def _is_carried(self) -> bool:
        """Return whether joined parts alone bore it, off the ground, for long enough."""
        count = round(self.scoring.borne_s * SAMPLE_RATE_HZ)
        if self.flight.released < count:
            return False
        window = slice(self.flight.released - count, self.flight.released + 1)
        gaps, joined = self.gaps[window], self.run.joined[window]
        center = self.run.positions[window, self.ball]
        close = np.where(joined, gaps, np.inf).min(axis=1) <= _NEAR
        strange = np.where(joined, np.inf, gaps).min(axis=1) <= TOUCH
        radius = radius_of(self.run, self.ball)
        lifted = gap_to_world(self.run.scenario, center, radius) > TOUCH
        return bool((close & lifted & ~strange).all())


def explain(scoring: ThrowScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if not metrics.get("flew"):
        if not metrics.get("touched"):
            return "No part that is joined to the machine touched the boulder: nothing threw it."
        return "The boulder did not fly: it stayed on the machine or fell to the ground at once."
    if scoring.rings and (score.success or metrics["distance"] >= scoring.min_distance):
        passed, count = metrics["rings"], len(scoring.rings)
        rings = f"{passed} of {count} rings" if count > 1 else "the ring" if passed else "no ring"
        return (
            f"The boulder passed {rings} and came down {metrics['distance']:.1f} beyond the line."
        )
    side = "beyond" if metrics["distance"] >= 0.0 else "short of"
    flew = f"The boulder came down {abs(metrics['distance']):.1f} {side} the line"
    asked = f"{scoring.min_distance:g} beyond it is asked"
    return f"{flew}; {asked}." if metrics["distance"] < scoring.min_distance else f"{flew}."


SCORER: Final = Scorer(
    parameters=ThrowScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(
        NOT_BORNE,
        CROSSED_LINE,
        THRUST_USED,
        NOT_FREE,
        BASE_MOVED,
        CAME_APART,
        UNEXPLAINED,
        START_TOO_HIGH,
    ),
    # A throw may go any distance, but pass a ring no nearer than its middle.
    ceiling=lambda scoring, _scenario: 2.0 * len(scoring.rings) or None,
)
