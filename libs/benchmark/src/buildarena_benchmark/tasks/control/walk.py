"""Walk: how far a machine walks, on feet that are carried through the air in turn."""

from functools import partial
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import CAME_APART, Flag
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, lasts
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, judged, undriven
from buildarena_benchmark.tasks.control.balancing import lean_deg
from buildarena_benchmark.tasks.control.walking import links_of, touching, walked
from buildarena_simulation import Scenario
from buildarena_simulation.scenario import GroundPlacement

NOT_WALKED: Final = Flag(
    name="not_walked",
    meaning="The starting block got far enough, but the machine did not walk there: its feet were "
    "not carried in turn, part of it stayed behind, it left its way or turned over.",
)
_EAST, _NORTH = 0, 1


class WalkScoring(Document):
    """Scoring of how far a machine walks north.

    Attributes:
        min_distance: Least distance to walk, units.
        lane: Largest distance of the starting block from the line that it walks along, units.
        max_tilt_deg: Largest tilt of the starting block relative to the built machine, degrees.
        max_part_tilt_deg: Largest tilt of every other part, degrees.
    """

    name: Literal["walk"]
    min_distance: Threshold = 8.0
    lane: Threshold = 1.5
    max_tilt_deg: Annotated[float, Field(gt=0, lt=90)] = 45.0
    max_part_tilt_deg: Annotated[float, Field(gt=0, lt=180)] = 120.0


def infeasible(scoring: WalkScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if not isinstance(scenario.placement, GroundPlacement):
        return "a walk is judged, but the machine is not put on the ground"
    return undriven(scenario)


def judge(scoring: WalkScoring, run: Run) -> Verdict:
    """Measure how far it walks north, units.

    What is joined by anything but a joint that moves is a link, and a link that touches ground or
    terrain is a foot. How far the machine walks is the least of how far the starting block came,
    how far its hindmost point did, and how far each foot was carried through the air by another
    that stayed. So what slides, rolls, jumps or stretches does not walk.

    It walks until something comes off, the starting block or another part is tilted too far, or
    the starting block is too far from the line.

    Flags:
        `came_apart`: it would have passed, but lost parts. `not_walked`: the starting block got far
        enough, but not so. `forces_not_measured`: cannot be judged.
    """
    intact = run.joined.all(axis=1)
    path = run.path[:, :2]
    upright = _upright(scoring, run)
    links = links_of(run)
    touches = touching(run, links)

    on_feet = walked(run, links, touches)
    along = partial(_walk, path, length=scoring.min_distance)
    distance, success, end = along(on_feet, upright & intact, lane=scoring.lane)
    _, with_losses, _ = along(on_feet, upright, lane=scoring.lane)
    progress = path[:, _NORTH] - path[0, _NORTH]
    _, anyhow, _ = along(progress, np.ones_like(intact), lane=np.inf)
    flags = {
        CAME_APART: with_losses and not success,
        NOT_WALKED: anyhow and not with_losses,
    }
    return judged(
        run,
        success=success,
        indicator=distance,
        flags=flags,
        metrics={
            "feet": int(touches.any(axis=0).sum()),
            "steps": _steps(touches[: end + 1]),
        },
        samples=end + 1,
    )


def _walk(
    path: Series, gone: Series, holds: NDArray[np.bool_], *, lane: float, length: float
) -> tuple[float, bool, int]:
    """Return how far it gets, whether far enough, and the sample up to which that was looked at.

    Args:
        path: (T, 2) of the starting block.
        gone: (T,) distance to the north.
        holds: (T,) bool, whether the walk may continue.
        lane: Largest distance from its line, units.
        length: Distance at which the walk is complete, units.
    """
    end = lasts(holds & (np.abs(path[:, _EAST]) <= lane))
    farthest = float(gone[: end + 1].max())
    return farthest, farthest >= length, end


def _upright(scoring: WalkScoring, run: Run) -> NDArray[np.bool_]:
    """Return when neither the starting block nor another part is tilted too far, (T,)."""
    tilts = [lean_deg(run, block) for block in range(len(run.trajectory.block_ids))]
    parts = np.max(tilts, axis=0) < scoring.max_part_tilt_deg
    return np.asarray(parts & (tilts[run.start] < scoring.max_tilt_deg))


def _steps(touches: NDArray[np.bool_]) -> int:
    """Return how often a foot was set down."""
    return int((touches[1:] & ~touches[:-1]).sum())


def explain(scoring: WalkScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    steps = score.metrics.get("steps", 0)
    went = f"It walked {score.indicator:.1f} in {steps} steps"
    return f"{went}." if score.success else f"{went}; {scoring.min_distance:g} is asked."


SCORER: Final = Scorer(
    parameters=WalkScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    flags=(CAME_APART, NOT_WALKED),
)
