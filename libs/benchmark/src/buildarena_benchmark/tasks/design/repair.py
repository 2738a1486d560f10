"""Regained: how much of a whole car's straight drive a repaired one has."""

from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Document, Threshold
from buildarena_benchmark.scoring.flags import NOT_DRIVEN
from buildarena_benchmark.scoring.measures.rolling import explained_distances
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import rotations
from buildarena_benchmark.scoring.scorer import Score, Scorer, Verdict, raised, rounded, undriven
from buildarena_benchmark.tasks.transport.scorer import DRIVE_NOT_MEASURED
from buildarena_simulation import Scenario


class RegainedScoring(Document):
    """Scoring of how far a car drives straight on, between a faulty one and a whole one.

    Attributes:
        faulty: Largest drive of a faulty car, units.
        whole: Least drive of a repaired car, units.
        corridor: Largest distance aside, units: the drive ends there.
        min_share: Least share of the way between the two for a success.
    """

    name: Literal["regained"]
    faulty: Threshold
    whole: Annotated[float, Field(gt=0, le=1e6)]
    corridor: Annotated[float, Field(gt=0, le=1e6)]
    min_share: Annotated[float, Field(gt=0, le=1)] = 0.8


def infeasible(scoring: RegainedScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scoring.faulty >= scoring.whole:
        return f"faulty {scoring.faulty:g} must be less than whole {scoring.whole:g}"
    return undriven(scenario)


def judge(scoring: RegainedScoring, run: Run) -> Verdict:
    """Measure the share of a whole car's straight drive that was regained, 0 to 1.

    The drive is how far the starting block gets towards what was the machine's north at the start,
    as far as wheels drove it there, see `explained_distances`, until it first leaves the corridor.
    The share is that drive less `faulty`, over `whole` less `faulty`: at least 0, at most 1.

    Flags:
        `not_driven`: far enough, but not by wheels. `drive_not_measured`: how wheels move is not
        known, so any drive counts.
    """
    start = run.start
    path = run.positions[:, start]
    built = np.array(run.machine.blocks[run.trajectory.block_ids[start]].world_from_block.rotation)
    towards = (
        rotations(run.trajectory.quaternions[:1, start])[0] @ built.T @ np.array([0.0, 1.0, 0.0])
    )
    north = towards[:2] / max(float(np.linalg.norm(towards[:2])), 1e-9)
    gone = path[:, :2] - path[0, :2]
    ahead, aside = gone @ north, np.abs(gone @ np.array([north[1], -north[0]]))
    left = np.flatnonzero(~(aside <= scoring.corridor))
    until = int(left[0]) if len(left) else len(path)
    explained = explained_distances(run, path)
    drive = float(np.minimum(ahead, explained)[:until].max(initial=0.0))
    anyhow = float(ahead[:until].max(initial=0.0))
    share = _share(scoring, drive)
    success = share >= scoring.min_share
    flags = {
        NOT_DRIVEN: not success and _share(scoring, anyhow) >= scoring.min_share,
        DRIVE_NOT_MEASURED: bool(np.isinf(explained).any()),
    }
    return Verdict(
        success=success,
        indicator=rounded(share),
        metrics={
            "straight_drive": rounded(drive),
            "left_corridor_s": rounded(run.time_s[until]) if len(left) else None,
            "broken_joints": len(run.trajectory.breaks),
        },
        flags=raised(flags),
    )


def _share(scoring: RegainedScoring, drive: float) -> float:
    share = (drive - scoring.faulty) / (scoring.whole - scoring.faulty)
    return min(max(share, 0.0), 1.0)


def explain(scoring: RegainedScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    drove = f"The car drove {metrics.get('straight_drive', 0.0):.1f} straight on"
    if metrics.get("left_corridor_s") is not None:
        drove += f" and left the corridor after {metrics['left_corridor_s']:.1f} s"
    asked = scoring.faulty + scoring.min_share * (scoring.whole - scoring.faulty)
    return f"{drove}." if score.success else f"{drove}; {asked:.0f} is asked."


SCORER: Final = Scorer(
    parameters=RegainedScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="places",
    flags=(NOT_DRIVEN, DRIVE_NOT_MEASURED),
    ceiling=lambda _scoring, _scenario: 1.0,
)
