"""Line: how much of a closed line a vehicle follows, and how fast."""

from collections.abc import Sequence
from itertools import groupby
from typing import Annotated, Final, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from buildarena_benchmark.fields import Count, Document, Threshold
from buildarena_benchmark.scoring.flags import NOT_DRIVEN
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.rolling import is_driven
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series
from buildarena_benchmark.scoring.measures.vehicles import has_wheels, in_order, paths_of, wheels_of
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_simulation import Scenario
from buildarena_simulation.line import Line

_ASTRAY: Final = -1


class LineScoring(Document):
    """Scoring of how much of a line a vehicle follows.

    Attributes:
        max_distance: Largest distance from the line that counts as on it, units.
        stretches: Number of stretches of equal length.
        min_stretches: Fewest followed stretches of a trial that passes.
        all_stretches: Number of stretches at which the line is complete and the measurement ends.
    """

    name: Literal["line"]
    max_distance: Threshold = 1.0
    stretches: Annotated[int, Field(ge=3, le=100)] = 12
    min_stretches: Count = 6
    all_stretches: Annotated[int, Field(ge=1, le=100)] = 11

    @model_validator(mode="after")
    def _are_in_order(self) -> Self:
        if not self.min_stretches <= self.all_stretches <= self.stretches:
            raise ValueError("min_stretches <= all_stretches <= stretches does not hold")
        return self


class _Pass(NamedTuple):
    """A stretch from its beginning to its end: its number, and the samples of both."""

    stretch: int
    first: int
    last: int


def infeasible(scoring: LineScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scenario.line is None:
        return "a line is followed, but scenario.line is missing"
    return undriven(scenario)


def judge(scoring: LineScoring, run: Run) -> Verdict:
    """Measure the length of the line that was followed per time, units/s.

    A stretch of the line is followed once the centre of the machine's mass and the middle of its
    wheels have both gone along it, from its beginning to its end without leaving it, driven by
    wheels, with all of them, and along no later stretch before. The time is that of the trial, or
    until nearly all stretches have been followed, which ends the measure.

    Flags:
        `not_driven`: stretches enough, but not by wheels. `forces_not_measured`: cannot be judged.
    """
    assert run.scenario.line is not None  # noqa: S101 - `infeasible` looked
    wheels = wheels_of(run)
    has_all_wheels = has_wheels(run.joined, wheels)
    paths = paths_of(run, wheels)
    passes = [_passes(scoring, run.scenario.line, path, has_all_wheels) for path in paths]
    driven = [
        [each for each in of if _is_driven(run, path, each)]
        for of, path in zip(passes, paths, strict=True)
    ]
    ends = _find_followed(driven)[: scoring.all_stretches]
    count = len(ends)
    anyhow = len(_find_followed(passes))
    is_all = count == scoring.all_stretches
    time_s = float(run.time_s[ends[-1]]) if is_all else run.scenario.duration_s
    length = count * run.scenario.line.length / scoring.stretches
    return judged(
        run,
        success=count >= scoring.min_stretches,
        indicator=length / time_s,
        flags={NOT_DRIVEN: anyhow >= scoring.min_stretches > count},
        metrics={
            "stretches": count,
            "length": length,
            "share": count / scoring.stretches,
            "all_followed_s": time_s if is_all else None,
            "wheels_lost": not bool(has_all_wheels[-1]),
        },
        samples=ends[-1] + 1 if is_all else len(has_all_wheels),
    )


def _passes(scoring: LineScoring, line: "Line", path: Series, driven: Mask) -> list[_Pass]:
    """Return each time that a path, with all wheels, goes along a stretch from beginning to end."""
    ways, distances = line.nearest(path)
    stretch = np.floor(ways * scoring.stretches / line.length).astype(int) % scoring.stretches
    stretch[(distances > scoring.max_distance) | ~driven] = _ASTRAY
    runs = _runs(stretch)
    passes = []
    for before, run, after in zip([None, *runs[:-1]], runs, runs[1:], strict=False):
        number = run.stretch
        if number == _ASTRAY:
            continue
        # At the start a machine is on the first stretch.
        begins = before.stretch == (number - 1) % scoring.stretches if before else number == 0
        if begins and after.stretch == (number + 1) % scoring.stretches:
            passes.append(_Pass(number, run.first, after.first))
    return passes


def _runs(stretch: NDArray[np.int_]) -> list[_Pass]:
    """Return the samples in a row on one stretch, first and last included."""
    rows = groupby(range(len(stretch)), key=lambda sample: int(stretch[sample]))
    return [_Pass(number, (of := list(samples))[0], of[-1]) for number, samples in rows]


def _is_driven(run: Run, path: Series, each: _Pass) -> bool:
    """Return whether wheels explain the way along a stretch at each of its samples."""
    return bool(is_driven(run, path, each.first)[each.first : each.last + 1].all())


def _find_followed(passes: Sequence[Sequence[_Pass]]) -> list[int]:
    """Return the samples at which stretches were followed by all of some paths, in order."""
    return in_order([(each.stretch, each.last) for each in of] for of in passes)


def explain(scoring: LineScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if metrics.get("all_followed_s") is not None:
        return f"It followed the whole line in {metrics['all_followed_s']:.1f} s."
    done = f"It followed {metrics.get('stretches', 0)} of {scoring.stretches} stretches in order"
    return f"{done}." if score.success else f"{done}; {scoring.min_stretches} are asked."


SCORER: Final = Scorer(
    parameters=LineScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(NOT_DRIVEN,),
)
