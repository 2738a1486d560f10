"""Delivery: a ball on the road goes over a line, pushed or carried."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Coordinate, Document, Threshold
from buildarena_benchmark.scoring.flags import Flag
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.gates import ahead_of, crossings, gate_of, unknown_gate
from buildarena_benchmark.scoring.measures.marks import MarkName
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series
from buildarena_benchmark.scoring.measures.thrown import distances_to_parts
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_simulation import Scenario
from buildarena_simulation.constants import SAMPLE_RATE_HZ
from buildarena_simulation.scenario import Gate

LET_GO: Final = Flag(
    name="let_go",
    meaning="The ball got over the line, but the machine was not at it on its way: it was thrown, "
    "kicked or let roll.",
)


class DeliverScoring(Document):
    """Scoring of how soon a ball gets over a line.

    Attributes:
        line: Name of the gate that is the line.
        min_height: Least height of the ball's underside when it crosses, units; None for any.
        max_relative_speed: Largest speed of the ball relative to a part that holds it, units/s.
        max_gap: Largest gap between the ball and a joined part that holds it, units.
        loose_s: Time for which it still counts as held afterwards, seconds: a pushed ball hops.
        max_loose: Largest way of the ball in all while the machine does not hold it, units.
    """

    name: Literal["deliver"]
    line: MarkName = "line"
    min_height: Coordinate | None = None
    max_relative_speed: Threshold = 2.0
    max_gap: Threshold = 0.3
    loose_s: Annotated[float, Field(gt=0, le=10)] = 0.4
    max_loose: Threshold = 3.0


def infeasible(scoring: DeliverScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    cargo, lacking = scenario.cargo, unknown_gate(scoring.line, scenario)
    if lacking is not None:
        return lacking
    if cargo is None or cargo.at is None or cargo.shape != "ball":
        return "a ball is delivered from its place: scenario.cargo needs shape: ball, and at"
    if _to_go(gate_of(scoring.line, scenario), np.array(cargo.at[:2])) <= 0.0:
        return f"the ball already lies beyond the gate {scoring.line!r}"
    if scenario.pushes or scenario.gusts is not None:
        return "gusts and pushes would deliver as well: a delivery is judged without them"
    if scenario.tracked_blocks != "all":
        return "whether a machine is at its ball is known only if all blocks are tracked"
    return undriven(scenario)


def judge(scoring: DeliverScoring, run: Run) -> Verdict:
    """Measure the share of the way to the line, plus the share of time left beyond it.

    The way counts while the ball is in the machine's hands: a part that is joined to the starting
    block is at it, or was a moment ago. A ball that moves far by itself earns no more.

    Flags:
        `let_go`: it got over the line by itself. `forces_not_measured`: cannot be judged.
    """
    gate, radius = gate_of(scoring.line, run.scenario), run.cargo_size[0] / 2
    path = run.cargo_path
    gaps = np.where(run.joined, distances_to_parts(run, path) - radius, np.inf)
    close = gaps <= scoring.max_gap
    parts = run.positions
    motion = np.diff(parts - path[:, None], axis=0, prepend=(parts - path[:, None])[:1])
    along = np.linalg.norm(motion, axis=2) * SAMPLE_RATE_HZ <= scoring.max_relative_speed
    held = _lately((close & along).any(axis=1), round(scoring.loose_s * SAMPLE_RATE_HZ))
    steps = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1)
    loose = np.cumsum(np.where(held, 0.0, steps))
    counts = loose <= scoring.max_loose
    lowest = -np.inf if scoring.min_height is None else scoring.min_height
    high = path[:, 2] - radius >= lowest
    over = [sample for sample in crossings(path, gate) if high[sample]]
    done = next((sample for sample in over if held[sample] and counts[sample]), None)
    full_way = _to_go(gate, path[0, :2])
    left = np.array([_to_go(gate, place) for place in path[:, :2]])
    way = np.where(held & counts, 1.0 - left / full_way, 0.0)
    share = 1.0 if done is not None else min(max(float(way.max()), 0.0), 1.0)
    time_left = 0.0 if done is None else 1.0 - run.time_s[done] / run.scenario.duration_s
    return judged(
        run,
        success=done is not None,
        indicator=share + time_left,
        metrics={
            "delivered_s": None if done is None else run.time_s[done],
            "way": share,
            "loose_way": float(loose[-1 if done is None else done]),
            "touched": bool(held.any()),
        },
        flags={LET_GO: done is None and bool(over)},
        samples=len(path) if done is None else done + 1,
        cargo=True,
    )


def _to_go(gate: "Gate", place: Series) -> float:
    """Return how far a place lies before a gate's line, units."""
    return float((np.array(gate.center) - place) @ ahead_of(gate))


def _lately(holds: Mask, samples: int) -> Mask:
    """Return samples at which something held then, or at one of some samples before, (T,)."""
    sums = np.concatenate([[0], np.cumsum(holds)])
    first = np.maximum(np.arange(len(holds)) - samples, 0)
    return np.asarray(sums[1:] > sums[first])


def explain(scoring: DeliverScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if not metrics.get("touched"):
        return "The machine never touched the ball."
    if metrics["delivered_s"] is not None and score.success:
        return f"The ball was delivered after {metrics['delivered_s']:.1f} s."
    way = f"The ball went {metrics['way']:.0%} of the way in the machine's hands"
    if metrics["loose_way"] > scoring.max_loose:
        loose = f"{metrics['loose_way']:.1f} by itself, of which {scoring.max_loose:g} is allowed"
        return f"{way}, and {loose}."
    return f"{way}; all of it is asked."


SCORER: Final = Scorer(
    parameters=DeliverScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="cargo",
    flags=(LET_GO,),
    ceiling=lambda _scoring, _scenario: 2.0,
)
