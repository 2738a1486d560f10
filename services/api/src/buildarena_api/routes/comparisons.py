"""Two sweeps side by side: the same models on the same tasks, in pairs where they share seeds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel, Field

from buildarena_api.dependencies import ExportingDep
from buildarena_api.http.concurrency import limited
from buildarena_api.http.problems import problem_responses
from buildarena_api.http.weights import HEAVIEST, weighs
from buildarena_api.leaderboard.policies import UnderPolicy
from buildarena_api.routes.leaderboard import TaskDuelView
from buildarena_benchmark.flags import ScoringPolicy
from buildarena_benchmark.leaderboard import EndedJob, compare_models, counted_trials
from buildarena_store import Store

router = APIRouter(prefix="/v1/sweeps", tags=["sweeps"], dependencies=[limited()])


class SweepSide(BaseModel):
    """One of two sweeps."""

    id: str
    name: str
    tracks: list[str] = Field(description="Of its ended jobs")
    ended: int = Field(description="Jobs that have ended")


class JobMetrics(BaseModel):
    """A job as a comparison counts it."""

    job: str
    success: bool
    indicator: float


class DifferingPair(BaseModel):
    """A task and a seed on which just one of both succeeded."""

    task: str
    seed: int
    first: JobMetrics
    second: JobMetrics


class SweepPair(BaseModel):
    """A model in both sweeps; or the only model of each."""

    first: str
    second: str
    tasks: list[TaskDuelView]
    differing: list[DifferingPair] = Field(description="By task and seed")


class LeftOut(BaseModel):
    """What can't be compared."""

    kind: Literal["model", "task"]
    name: str
    why: str


class SweepComparison(UnderPolicy):
    """Two sweeps, model by model; p-values are adjusted over the tests of one model (Holm)."""

    first: SweepSide
    second: SweepSide
    pairs: list[SweepPair]
    left_out: list[LeftOut]


@router.get(
    "/{sweep_id}/compare/{other_id}",
    response_model=SweepComparison,
    responses=problem_responses(404, 422, 503),
)
@weighs(HEAVIEST)
async def compare_sweeps(
    sweep_id: str,
    other_id: str,
    exporting: ExportingDep,
    *,
    policy: Annotated[
        ScoringPolicy, Query(description="The scoring policy: how flags are read")
    ] = ScoringPolicy.OURS,
) -> Response:
    """Compares two sweeps: what differs between their tracks or settings is what is measured."""
    body = await exporting.run(_compared, exporting.context.store, (sweep_id, other_id), policy)
    return Response(body, media_type="application/json")


def _compared(store: Store, ids: tuple[str, str], policy: ScoringPolicy) -> bytes:
    sides, trials = zip(*(_side(store, id_) for id_ in ids), strict=True)
    same, left_out = _same_tasks(*trials)
    models = [list(dict.fromkeys(trial.model for trial in side)) for side in same]
    if all(len(names) == 1 for names in models):
        named = [(models[0][0], models[1][0])]
    else:
        named = [(name, name) for name in models[0] if name in models[1]]
        left_out += [
            LeftOut(kind="model", name=name, why="one sweep has no ended job of it")
            for name in sorted(set(models[0]) ^ set(models[1]))
        ]
    pairs = [
        _pair(
            [trial for trial in same[0] if trial.model == first],
            [trial for trial in same[1] if trial.model == second],
            policy,
        )
        for first, second in named
    ]
    comparison = SweepComparison(
        first=sides[0],
        second=sides[1],
        policy=policy,
        pairs=[pair for pair in pairs if pair is not None],
        left_out=left_out,
    )
    return comparison.model_dump_json().encode()


def _side(store: Store, sweep_id: str) -> tuple[SweepSide, list[EndedJob]]:
    sweep = store.sweeps.get(sweep_id)
    trials = [trial for trial, _ in store.results.boards.of_sweep(sweep_id)]
    tracks = sorted({trial.track for trial in trials})
    side = SweepSide(id=sweep.id, name=sweep.name, tracks=tracks, ended=len(trials))
    return side, trials


def _same_tasks(
    first: Sequence[EndedJob], second: Sequence[EndedJob]
) -> tuple[tuple[list[EndedJob], list[EndedJob]], list[LeftOut]]:
    """The trials of both on tasks that both have in one version, and the tasks left out."""
    versions = [{(t.task, t.task_version) for t in side} for side in (first, second)]
    shared = versions[0] & versions[1]
    kept = {task for task, _ in shared}
    in_both = {task for task, _ in versions[0]} & {task for task, _ in versions[1]}
    left_out = [
        LeftOut(
            kind="task",
            name=task,
            why="the sweeps have other versions of it"
            if task in in_both
            else "one sweep has no ended job of it",
        )
        for task in sorted({task for task, _ in versions[0] | versions[1]} - kept)
    ]
    sides = [[t for t in side if (t.task, t.task_version) in shared] for side in (first, second)]
    return (sides[0], sides[1]), left_out


def _pair(
    first: Sequence[EndedJob], second: Sequence[EndedJob], policy: ScoringPolicy
) -> SweepPair | None:
    found = compare_models(first, second, policy=policy)
    if found is None:
        return None
    return SweepPair(
        first=found.first,
        second=found.second,
        tasks=[TaskDuelView.model_validate(task) for task in found.tasks],
        differing=_differing(first, second, policy),
    )


def _differing(
    first: Sequence[EndedJob], second: Sequence[EndedJob], policy: ScoringPolicy
) -> list[DifferingPair]:
    """Pairs with one success, of the trials that the tests count."""
    sides = [
        {(trial.task, trial.seed): trial for trial in counted_trials(side, policy=policy)}
        for side in (first, second)
    ]
    return [
        DifferingPair(task=task, seed=seed, first=_figures(one), second=_figures(another))
        for (task, seed), one in sorted(sides[0].items(), key=lambda item: item[0])
        if (another := sides[1].get((task, seed))) and one.success != another.success
    ]


def _figures(trial: EndedJob) -> JobMetrics:
    return JobMetrics(job=trial.job_id, success=trial.success, indicator=trial.indicator)
