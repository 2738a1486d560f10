"""Slalom: how soon a vehicle that keeps its wheels passes gates in order."""

from collections.abc import Sequence
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Count, Document
from buildarena_benchmark.scoring.flags import NOT_DRIVEN
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.gates import crossings
from buildarena_benchmark.scoring.measures.outline import extents
from buildarena_benchmark.scoring.measures.rolling import driven_distances, moved_upright
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series
from buildarena_benchmark.scoring.measures.vehicles import has_wheels, in_order, paths_of, wheels_of
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_simulation import Scenario

_TOUCHES: Final = 0.1
"""Height below which a block's lowest point touches the ground, units."""


class SlalomScoring(Document):
    """Scoring of how soon a vehicle passes gates in order.

    Attributes:
        min_gates: Fewest gates of a trial that passes.
        keeps_within: Whether every wheel, and every block that touches the ground, must cross a
            gate's line within its width, so that nothing straddles a course.
    """

    name: Literal["slalom"]
    min_gates: Count = 4
    keeps_within: Annotated[bool, Field(exclude_if=lambda value: not value)] = False


def infeasible(scoring: SlalomScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    count = len(scenario.gates)
    if not count or count < scoring.min_gates:
        return f"{scoring.min_gates} gates are asked for, but scenario.gates has {count}"
    return undriven(scenario)


def judge(scoring: SlalomScoring, run: Run) -> Verdict:
    """Measure the mean over the gates of the share of the time left when each is passed.

    A gate is passed once the centre of the machine's mass and the middle of its wheels have both
    crossed its line in its direction, driven by wheels, with all of them, and neither a later gate
    before. A gate that is not passed is worth 0.

    Flags:
        `not_driven`: gates enough, but not by wheels. `forces_not_measured`: cannot be judged.
    """
    wheels = wheels_of(run)
    has_all_wheels = has_wheels(run.joined, wheels)
    paths = paths_of(run, wheels)
    driven = [has_all_wheels & _drives(run, path) for path in paths]
    if scoring.keeps_within:
        low, _ = extents(run, axis=2)
        touching = np.flatnonzero((low < _TOUCHES).any(axis=0))
        for column in {*wheels, *touching.tolist()}:
            paths.append(run.positions[:, column])
            driven.append(has_all_wheels)
    passed = _find_passes(run.scenario, paths, driven)
    anyhow = _find_passes(run.scenario, paths, [has_all_wheels] * len(paths))
    gates = len(passed)
    left = 1.0 - run.time_s[passed] / run.scenario.duration_s
    return judged(
        run,
        success=gates >= scoring.min_gates,
        indicator=left.sum() / len(run.scenario.gates),
        flags={NOT_DRIVEN: len(anyhow) >= scoring.min_gates > gates},
        metrics={
            "gates": gates,
            "last_gate_s": run.time_s[passed[-1]] if passed else None,
            "wheels_lost": not bool(has_all_wheels[-1]),
        },
        samples=len(has_all_wheels),
    )


def _find_passes(scenario: Scenario, paths: Sequence[Series], counts: Sequence[Mask]) -> list[int]:
    """Return the samples at which gates were passed by all of some paths, in order.

    Args:
        paths: (T, 3) each.
        counts: (T,) bool each, whether crossings of the path count.
    """
    crossed = [
        sorted(
            (sample, number)
            for number, gate in enumerate(scenario.gates)
            for sample in crossings(path, gate)
            if counting[sample]
        )
        for path, counting in zip(paths, counts, strict=True)
    ]
    return in_order([(number, sample) for sample, number in way] for way in crossed)


def _drives(run: Run, path: Series) -> Mask:
    """Return when wheels explain where the machine is, (T,)."""
    driven = driven_distances(run, path)
    if driven is None:
        return np.zeros(len(path), dtype=bool)
    moved = np.linalg.norm(path[:, :2] - path[0, :2], axis=1)
    return np.asarray(moved <= np.minimum(driven, moved_upright(run, path)))


def explain(scoring: SlalomScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    gates, last = score.metrics.get("gates", 0), score.metrics.get("last_gate_s")
    passed = f"It passed {gates} of {len(scenario.gates)} gates"
    if last is not None:
        passed += f", the last after {last:.1f} s"
    return f"{passed}." if score.success else f"{passed}; {scoring.min_gates} are asked."


SCORER: Final = Scorer(
    parameters=SlalomScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(NOT_DRIVEN,),
    ceiling=lambda _scoring, _scenario: 1.0,
)
