"""Transport: how far a vehicle, or a cargo on it, is moved over the ground."""

from itertools import combinations
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from buildarena_benchmark.fields import Coordinate, Count, Document, Threshold
from buildarena_benchmark.scoring.flags import NOT_DRIVEN, START_TOO_HIGH, Flag
from buildarena_benchmark.scoring.measures.carrying import bears_cargo
from buildarena_benchmark.scoring.measures.components import Mask
from buildarena_benchmark.scoring.measures.rolling import explained_distances, is_driven
from buildarena_benchmark.scoring.measures.run import Run
from buildarena_benchmark.scoring.measures.series import Series, speeds
from buildarena_benchmark.scoring.scorer import Metric, Score, Scorer, Verdict, judged, rounded
from buildarena_benchmark.scoring.stability import AtRest
from buildarena_benchmark.tasks.transport.route import there_and_back
from buildarena_simulation import Scenario
from buildarena_simulation.trial import Decision

_SETTLED_S = 2.0
"""Secondary metrics count from here on: cargo and wheels need a moment to settle."""

_INTACT_SPREAD = 1.0
"""Wheel-to-wheel distances of an intact vehicle vary by no more, units."""

_RESTING = 1e-3
"""Slower movement has no direction worth judging, units/s."""


NO_WHEELS: Final = Flag(name="no_wheels", meaning="A vehicle got far without a single wheel.")
DRIVE_NOT_MEASURED: Final = Flag(
    name="drive_not_measured",
    meaning="The trial has no contacts of wheels, so whether they drove was not measured.",
    disqualifying=False,
)


class TransportScoring(Document):
    """Scoring of how far something is moved over the ground.

    Attributes:
        subject: The horizontal distance of this from its start counts.
        min_distance: Indicator that must be exceeded, units.
        min_wheels: Fewest wheels of a machine that passes.
        max_start_height: Bound of the highest start position, units.
        target: (2,) place to go to, units; for secondary metrics only, unless `back` is true.
        back: Whether the way to the target and back counts, in place of the distance.
        reach: Largest distance of the subject to the target, and then to its start, units.
    """

    name: Literal["transport"]
    subject: Literal["starting_block", "cargo"]
    min_distance: Threshold = 10.0
    min_wheels: Count = 0
    max_start_height: Threshold = 20.0
    target: tuple[Coordinate, Coordinate] = (10.0, 10.0)
    back: Annotated[bool, Field(exclude_if=lambda value: not value)] = False
    reach: Threshold = 2.0


def infeasible(scoring: TransportScoring, scenario: Scenario) -> str | None:
    """Return why no machine can pass; see `Scorer`."""
    if scoring.subject == "cargo" and scenario.cargo is None:
        return "the cargo is judged, but scenario has no cargo"
    if scenario.control.mode != "agent":
        return "a vehicle is judged, but not driven: scenario.control.mode must be agent"
    if scoring.back and np.hypot(*scoring.target) <= scoring.reach:
        return f"the target is within reach {scoring.reach:g} of the start: no way leads to it"
    return None


def decision(scoring: TransportScoring, scenario: Scenario) -> Decision:
    """Return a test for the sample at which nothing moves and no key is left, see `Scorer`."""
    return AtRest(scenario)


def judge(scoring: TransportScoring, run: Run) -> Verdict:
    """Measure the greatest horizontal distance the subject was driven from its start.

    At each moment the distance counts as far as wheels have carried the machine, see
    `driven_distances`, and no farther than its other blocks went with it. A cargo counts while the
    machine carries it. The trial succeeds if the indicator exceeds the distance asked for, the
    machine has wheels enough and nothing starts too high. A machine that nothing drives (no key
    bound, none pressed, nothing powered) fails with an indicator of 0. Where it is to come back,
    the indicator is how much of the way there and back it was driven, see `there_and_back`; the
    trial succeeds if it was there and back, and the distance is a metric.

    Flags:
        `no_wheels`: far enough without any wheel. `start_too_high`: something started at or above
        the limit. `not_driven`: far enough, but not by wheels. `drive_not_measured`: contacts or
        motion of the wheels are not known, so any distance counts.

    Source: the paper, section "Evaluation"; thresholds as in the published evaluation.
    """
    path = _subject_path(scoring, run)
    wheels = [b.id for b in run.machine.blocks.values() if b.module.motor]
    if path is None or not _is_driven(run):
        return Verdict(
            success=False, indicator=0.0, metrics={"wheels": len(wheels), "driven": False}
        )
    moved = np.linalg.norm(path[:, :2] - path[0, :2], axis=1)
    reach = explained_distances(run, path)
    measured = not np.isinf(reach).any()
    carried = bears_cargo(run) if measured and scoring.subject == "cargo" else None
    counted = np.where(True if carried is None else carried, np.minimum(moved, reach), 0.0)
    distance, indicator = float(moved.max()), float(counted.max())
    places = path[0, 2] if scoring.subject == "cargo" else run.positions[0, :, 2]
    start_height = float(np.max(places))
    too_high = start_height >= scoring.max_start_height
    enough = len(wheels) >= scoring.min_wheels
    reached = indicator > scoring.min_distance and enough
    moved_enough = distance > scoring.min_distance and enough
    route: dict[str, Metric] = {}
    if scoring.back:

        def counts(since: int) -> Mask:
            driven = is_driven(run, path, since)
            return driven if carried is None else driven & carried

        target = np.array(scoring.target)
        done = there_and_back(path, target, scoring.reach, counts)
        anyhow = there_and_back(
            path, target, scoring.reach, lambda _: np.ones(len(path), dtype=bool)
        )
        route = {
            "driven_distance": rounded(indicator),
            "there_s": _time_of(run, done.arrival),
            "back_s": _time_of(run, done.back),
        }
        indicator = done.way
        reached = done.back is not None and enough
        moved_enough = anyhow.back is not None and enough
    flags = {
        NO_WHEELS: moved_enough and not wheels,
        START_TOO_HIGH: too_high,
        NOT_DRIVEN: moved_enough and not reached,
        DRIVE_NOT_MEASURED: not measured,
    }
    settled = run.time_s >= _SETTLED_S
    return judged(
        run,
        success=reached and not too_high,
        indicator=indicator,
        flags=flags,
        metrics={
            "wheels": len(wheels),
            "driven": True,
            "start_height": start_height,
            "displacement": distance,
            **route,
            "intact": _is_intact(run, wheels),
            "max_speed": speeds(run.time_s, path[:, None]).max(initial=0.0),
            "broken_joints": len(run.trajectory.breaks),
            **_path_metrics(run.time_s[settled], path[settled, :2], scoring.target),
        },
        samples=len(path),
        cargo=scoring.subject == "cargo",
    )


def _time_of(run: Run, sample: int | None) -> float | None:
    return None if sample is None else rounded(run.time_s[sample])


def _subject_path(scoring: TransportScoring, run: Run) -> Series | None:
    if scoring.subject == "cargo":
        cargo = run.trajectory.cargo_position
        return None if cargo is None else cargo.astype(np.float64)
    return run.path


def _is_driven(run: Run) -> bool:
    """Return whether any key that was pressed is bound to something that is powered."""
    presses = run.trajectory.settings.get("effective_key_presses")
    if presses is not None:
        return int(presses) > 0
    bound = {
        key
        for block in run.machine.blocks.values()
        for keys in block.bindings.values()
        for key in keys
    }
    return any(press.key in bound for press in run.machine.control_sequence)


def _is_intact(run: Run, wheels: list[str]) -> bool:
    tracked = [run.trajectory.block_ids.index(i) for i in wheels if i in run.trajectory.block_ids]
    for first, second in combinations(tracked, 2):
        distances = np.linalg.norm(
            run.positions[:, first] - run.trajectory.positions[:, second],
            axis=1,
        )
        if distances.max() - distances.min() > _INTACT_SPREAD:
            return False
    return True


def _path_metrics(time_s: Series, path: Series, target: tuple[float, float]) -> dict[str, Metric]:
    """Return how well a horizontal path leads from its start to the target, weighted by time.

    Args:
        time_s: (T,) seconds.
        path: (T, 2) units.
        target: (2,) units, from the world's origin.
    """
    if len(path) < 2:  # noqa: PLR2004 - no step, no path
        return {}
    aim = np.array(target) - path[0]
    distance = float(np.linalg.norm(aim)) or 1.0
    aim = aim / distance
    moved = np.diff(path, axis=0)
    steps = np.diff(time_s)
    along = (path - path[0]) @ aim
    across = np.abs((path - path[0]) @ np.array([-aim[1], aim[0]]))
    lengths = np.linalg.norm(moved, axis=1)
    moving = lengths > _RESTING * steps
    headings = (moved[moving] @ aim) / lengths[moving]
    travelled = float(lengths.sum())
    remaining = float(np.linalg.norm(np.array(target) - path[-1]))
    backward = np.minimum(np.diff(along), 0.0)
    return {
        "progress_ratio": rounded(along.max() / distance),
        "direction_consistency": rounded(np.average(headings, weights=steps[moving]))
        if moving.any()
        else None,
        "backtrack": rounded(-backward.sum() / distance),
        "lateral_deviation": rounded(np.average((across[1:] + across[:-1]) / 2, weights=steps)),
        "path_efficiency": rounded(float(np.linalg.norm(path[-1] - path[0])) / travelled)
        if travelled > 0
        else None,
        "final_distance_ratio": rounded(remaining / distance),
    }


def explain(scoring: TransportScoring, scenario: Scenario, score: Score) -> str:
    """Return what happened; see `Scorer`."""
    metrics = score.metrics
    if not metrics.get("driven"):
        wheels = metrics.get("wheels", 0)
        return f"It did not drive: no key turned a powered wheel, of which it has {wheels}."
    subject = "The cargo" if scoring.subject == "cargo" else "The vehicle"
    if scoring.back and not score.success:
        reached = (
            "reached the point but did not come back"
            if metrics.get("there_s")
            else "did not reach the point"
        )
        return f"{subject} {reached}; it was driven {metrics.get('driven_distance', 0.0):.1f}."
    way = f"{subject} was driven {score.indicator:.1f} away"
    return f"{way}." if score.success else f"{way}; {scoring.min_distance:g} is asked."


SCORER: Final = Scorer(
    parameters=TransportScoring,
    judge=judge,
    explain=explain,
    infeasible=infeasible,
    needs="places",
    flags=(NOT_DRIVEN, NO_WHEELS, START_TOO_HIGH, DRIVE_NOT_MEASURED),
    decision=decision,
)
