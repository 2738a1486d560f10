"""Scoring of a job's rollouts, and the manifest that makes a score verifiable."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from buildarena_backend import __version__
from buildarena_backend.catalog.tasks import TaskCatalog
from buildarena_backend.catalog.tracks import is_paper
from buildarena_backend.errors import PermanentError
from buildarena_backend.jobs.job import Job
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.results.results import JobScore
from buildarena_backend.states import Outcome
from buildarena_backend.trials.simulator import BESIEGE
from buildarena_benchmark import Task, failed_score
from buildarena_benchmark.families.hidden_parameters import sample_hidden_parameters
from buildarena_benchmark.scoring.registry import known_scorers
from buildarena_geometry import DOCUMENT_VERSION, Machine
from buildarena_geometry import __version__ as geometry_version
from buildarena_simulation.constants import AFTER_S

EXCLUDED_BY_PAPER: Final = frozenset({"no_wheels", "start_too_high", "twr_below_one", "never_fell"})
"""Flags of trials that the published evaluation leaves out."""
PASSED_FROM: Final = 0.5
"""Share of its worlds that a machine passes, at least, if its job is a success."""


def task_of(job: Job, catalogue: TaskCatalog) -> Task:
    """Return the job's task, in the version that the job was submitted for, drawn by its seed.

    Raises:
        PermanentError: It is gone, or its scoring has changed.
    """
    task = find_task(job, catalogue)
    if task is None:
        raise PermanentError(
            f"task {job.task} is no longer at version {job.task_version[:12]}: submit it again",
            reason="task_changed",
        )
    return task


def find_task(job: Job, catalogue: TaskCatalog) -> Task | None:
    """Return a job's task with its sampled parameters; None if it is gone.

    Hidden parameters are drawn by a number that the job keeps to itself: a seed is chosen by the
    submitter, and other jobs have it too. Rounds of a closed loop replace test trials; the
    paper's protocol has none.
    """
    task = catalogue.exact(job.task, job.task_version)
    if task is None:
        return None
    rounds = int(job.track_config.get("rounds", 1))
    if task.hidden_parameters is None and (rounds > 1 or is_paper(job.track_config)):
        task = replace(task, test_trials=0)
    hidden = None if task.hidden_parameters is None else job.randomization_seed
    return task.with_seed(job.seed if hidden is None else hidden)


def has_counted(records: Sequence[RolloutRecord], task: Task) -> bool:
    """Return whether a scored trial is done: the one after any test trials."""
    return any(r.finished_at is not None and (r.final or not task.test_trials) for r in records)


def best_rollout(records: Sequence[RolloutRecord], task: Task) -> RolloutRecord:
    """Return the rollout that counts.

    Where a task has test trials it is the last, which is none. Otherwise, of those in the exact
    world a success before none, one that no flag disqualifies before others,
    then the larger indicator, then the first.
    """
    done = [r for r in records if r.finished_at is not None and not r.is_varied]
    if task.test_trials:
        return max(done, key=lambda r: (r.final, r.number))
    return max(
        done,
        key=lambda r: (
            r.counts,
            bool(r.success),
            r.indicator or 0.0,
            -r.number,
        ),
    )


def varied_rollouts(records: Sequence[RolloutRecord]) -> Sequence[RolloutRecord]:
    """Return the rollouts in varied worlds, done or not, without test trials."""
    return [record for record in records if record.is_varied]


def scored_worlds(task: Task, records: Sequence[RolloutRecord]) -> list[RolloutRecord]:
    """Return the trials that a job is scored by: the best in the exact world, then varied ones."""
    if not has_counted(records, task):
        return []
    done = [record for record in varied_rollouts(records) if record.finished_at is not None]
    return [best_rollout(records, task), *done]


def rollout_score(job: Job, task: Task, records: Sequence[RolloutRecord]) -> JobScore:
    """Return the score of a job: the mean over its worlds, of which the exact one is one.

    A world in which the machine fails, or succeeds in a way that disqualifies, counts as 0. The
    job is a success if the machine passes at least half of its worlds.

    Args:
        task: Its task, see `sample_task`.
        records: All its rollouts: those in varied worlds are of the best one's machine.
    """
    best, *_varied = worlds = scored_worlds(task, records)
    gained = [world.score.indicator for world in worlds if world.counts]
    share = len(gained) / len(worlds)
    counts = {} if len(worlds) == 1 else {"worlds": len(worlds), "worlds_passed": len(gained)}
    if task.test_trials:
        counts["test_trials"] = sum(not record.final for record in records)
    outcome = Outcome.SUCCESS if share >= PASSED_FROM else Outcome.UNSUCCESSFUL
    if is_paper(job.track_config) and not EXCLUDED_BY_PAPER.isdisjoint(best.flags or ()):
        outcome = Outcome.EXCLUDED
    return JobScore(
        outcome=outcome,
        success=share,
        indicator=math.fsum(gained) / len(worlds),
        metrics={**(best.metrics or {}), **counts},
        flags=best.flags or (),
        manifest=job_manifest(job, task, best),
    )


def failure_score(
    job: Job, task: Task, machine: Machine | None, *, outcome: Outcome, reason: str, detail: str
) -> JobScore:
    """Return the score of a job that ended without a rollout.

    Args:
        machine: Machine whose parts are counted, if any was built.
        outcome: ``construction_failed`` or ``limit``.
        reason: Class of the failure.
        detail: A sentence for people.
    """
    failed = failed_score(task, machine)
    return JobScore(
        outcome=outcome,
        success=float(failed.success),
        indicator=failed.indicator,
        metrics=failed.metrics,
        flags=failed.flags,
        reason=reason,
        detail=detail,
        manifest=job_manifest(job, task, None),
    )


def job_manifest(job: Job, task: Task, record: RolloutRecord | None) -> Mapping[str, Any]:
    """Return the versions of everything that can change the score, and hashes of its inputs.

    Hidden parameters are in it: the job has ended, so they give no advantage.
    """
    manifest: dict[str, Any] = {
        "buildarena": __version__,
        "geometry": geometry_version,
        "document": DOCUMENT_VERSION,
        "task": {"name": job.task, "version": job.task_version},
        "model": dict(job.model_config),
        "track": dict(job.track_config),
        "seed": job.seed,
    }
    if task.hidden_parameters is not None:
        manifest["drawn"] = sample_hidden_parameters(task.hidden_parameters, task.seed)
    if record is not None:
        manifest["simulator"] = dict(record.versions or {})
        manifest["machine"] = record.machine_hash
        manifest["trajectory"] = record.trajectory_hash
        manifest["rollout"] = record.number
        ends_early = known_scorers()[task.scorer].decision and record.engine != BESIEGE
        manifest["trial_ends"] = f"{AFTER_S:g} s after it is decided" if ends_early else "whole"
    return manifest
