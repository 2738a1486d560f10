"""Submissions: creation of all jobs of a request in the database, or of none."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy.exc import IntegrityError

from buildarena_backend.catalog.models import ModelRegistry
from buildarena_backend.catalog.prompt_packs import PromptPacks
from buildarena_backend.catalog.specs import Budget, Decoding, JobSpec, SweepSpec, Variant
from buildarena_backend.catalog.tracks import Track
from buildarena_backend.catalog.workflows import workflow_sources
from buildarena_backend.errors import RefusedError, SubmissionError
from buildarena_backend.ids import content_hash, new_id
from buildarena_backend.jobs.job import Job, NewJobs, configuration_hash
from buildarena_backend.process.context import Context
from buildarena_backend.states import CONSTRUCT_QUEUE
from buildarena_backend.submission.estimates import estimate
from buildarena_backend.sweeps.claims import add_claim
from buildarena_backend.sweeps.sweeps import NewSweep, Sweep
from buildarena_backend.telemetry.tracing import current_traceparent
from buildarena_backend.trials.known_simulators import (
    sampling_issues,
    simulation_version,
    simulator_issues,
    worlds_here,
    worlds_issues,
)
from buildarena_benchmark import Task, ValidationIssue, paper_tasks


@dataclass(frozen=True, slots=True, kw_only=True)
class Submitted:
    """A sweep that was accepted.

    Attributes:
        added: Number of new jobs; the others existed before.
        resumed: Whether an earlier submission of the same jobs continues.
        fresh: Whether the sweep is new, and not the result of an earlier request.
    """

    sweep: Sweep
    jobs: int
    added: int
    resumed: bool = False
    fresh: bool = True


class Submissions:
    """Checks and stores submissions."""

    def __init__(self, context: Context, registry: ModelRegistry) -> None:
        self._context = context
        self._registry = registry
        self._packs = PromptPacks(context.settings.prompt_packs)
        self._workflows = workflow_sources(context.settings.workflows)

    def submit_job(self, spec: JobSpec, *, owner: str | None = None) -> tuple[Job, bool]:
        """Store a job and notify workers of it.

        Args:
            owner: Id of the API key that submits it, if any.

        Returns:
            The job, and whether it is new: an equal job is never done twice.

        Raises:
            SubmissionError: Something of it is unknown; nothing was stored.
        """
        new = self._plan(spec, {"task": spec.task}, {"model": spec.model}, [spec.seed])
        traceparent = current_traceparent()
        own = [replace(some, owner=owner, traceparent=traceparent) for some in new]
        (job_id,) = own[0].job_ids
        with self._context.store.lifecycle.submission() as connection:
            added = self._context.store.jobs.add(own, connection=connection)
            add_claim(job_id, owner, connection=connection)
        self._context.queues.wake(CONSTRUCT_QUEUE)
        return self._context.store.jobs.get(job_id), added > 0

    def submit_sweep(
        self,
        spec: SweepSpec,
        *,
        owner: str | None = None,
        request_key: str | None = None,
        resume: bool = False,
    ) -> Submitted:
        """Store a sweep with its jobs and notify workers of them.

        Args:
            owner: Id of the API key that submits it, if any.
            request_key: Names the request, if it has a name: one that comes again, or another
                under its name, gets the first one's sweep.
            resume: Whether the owner's earlier sweep of just these jobs, if there is one, goes
                on with this one's budget, instead of a further sweep being stored.

        Raises:
            SubmissionError: Something of it is unknown; nothing was stored.
            RefusedError: The request's name was another sweep's.
        """
        sweep_id = new_id("sweep") if request_key is None else f"sweep_{request_key[:20]}"
        if request_key is not None and (existing := self._known(sweep_id, spec)):
            return existing
        try:
            return self._store(sweep_id, spec, owner, resume=resume)
        except IntegrityError:
            # Another request of this name was quicker.
            if request_key is None or (existing := self._known(sweep_id, spec)) is None:
                raise
            return existing

    def _known(self, sweep_id: str, spec: SweepSpec) -> Submitted | None:
        sweep = self._context.store.sweeps.find(sweep_id)
        if sweep is None:
            return None
        if sweep.request_hash != spec_hash(spec):
            detail = "this Idempotency-Key was used for another request"
            raise RefusedError("idempotency_key_reused", detail)
        number = self._context.store.sweeps.size(sweep_id)
        return Submitted(sweep=sweep, jobs=number, added=0, fresh=False)

    def _store(
        self, sweep_id: str, spec: SweepSpec, owner: str | None, *, resume: bool
    ) -> Submitted:
        new = self.plan(spec)
        job_ids = [id_ for some in new for id_ in some.job_ids]
        jobs_hash = content_hash(sorted(job_ids))
        sweep = NewSweep(
            id=sweep_id,
            name=spec.name,
            spec=spec.model_dump(mode="json", exclude_none=True),
            owner=owner,
            request_hash=spec_hash(spec),
            jobs_hash=jobs_hash,
        )
        traceparent = current_traceparent()
        own = [replace(some, owner=owner, payer=sweep.id, traceparent=traceparent) for some in new]
        limits = None if spec.budget is None else spec.budget.as_limits()
        store = self._context.store
        before, added = None, 0
        with store.lifecycle.command() if resume else store.lifecycle.submission() as connection:
            if resume:
                before = store.sweeps.with_jobs(jobs_hash, owner=owner, connection=connection)
            if before is not None:
                store.lifecycle.ensure_active(before, limits, connection=connection)
            else:
                if limits is not None:
                    store.budgets.set(sweep.id, limits, connection=connection)
                added = store.jobs.add(own, connection=connection)
                store.sweeps.add(sweep, job_ids, connection=connection)
        self._context.queues.wake(CONSTRUCT_QUEUE, len(job_ids))
        return Submitted(
            sweep=store.sweeps.get(before or sweep.id),
            jobs=len(job_ids),
            added=added,
            resumed=before is not None,
            fresh=before is None,
        )

    def resume(self, sweep_id: str, budget: Budget | None) -> None:
        """Let a paused or stopped sweep go on, with another budget if one is given.

        Raises:
            UnknownIdError: The sweep does not exist.
            RefusedError: It is active or cancelled.
        """
        limits = None if budget is None else budget.as_limits()
        self._context.store.lifecycle.resume(sweep_id, limits)
        self._context.queues.wake(CONSTRUCT_QUEUE)

    def set_budget(self, sweep_id: str, budget: Budget) -> None:
        """Give a sweep another budget; one whose budget was used up continues.

        Raises:
            UnknownIdError: The sweep does not exist.
            RefusedError: It is cancelled.
        """
        self._context.store.lifecycle.set_budget(sweep_id, budget.as_limits())
        self._context.queues.wake(CONSTRUCT_QUEUE)

    def standard_track(self) -> str:
        """Return the track of a sweep that names nothing but tasks and models."""
        return self._track(Variant(), on_demand=False).id

    def estimate(self, spec: SweepSpec) -> Mapping[str, Any]:
        """Return an estimate of a sweep's use, without storing anything.

        Raises:
            SubmissionError: Something of it is unknown, or it is too large.
        """
        result = estimate(self.plan(spec), self._registry)
        max_cost = math.inf if spec.budget is None else spec.budget.max_cost_usd or math.inf
        max_cost = min(result["max_cost_usd"], max_cost)
        return {**result, "max_cost_usd": max_cost if math.isfinite(max_cost) else None}

    def plan(self, spec: SweepSpec) -> list[NewJobs]:
        """Return the jobs that a sweep consists of, without storing anything.

        Raises:
            SubmissionError: Something of it is unknown, or it is too large.
        """
        tasks = {f"tasks[{index}]": name for index, name in enumerate(spec.tasks)}
        models = {f"models[{index}]": name for index, name in enumerate(spec.models)}
        return self._plan(spec, tasks, models, spec.all_seeds())

    def _plan(
        self,
        variant: Variant,
        tasks: Mapping[str, str],
        models: Mapping[str, str],
        seeds: Sequence[int],
    ) -> list[NewJobs]:
        """Return jobs of every task, model and seed; names come by their paths in the spec."""
        known_tasks = self._context.tasks.select(list(tasks.values()))
        self._require_known(variant, tasks, models, known_tasks)
        task_names, model_names = set(tasks.values()), set(models.values())
        self._require_size(len(task_names) * len(model_names) * len(seeds))
        tracks = {on_demand: self._track(variant, on_demand) for on_demand in (False, True)}
        limits = variant.limits.model_dump(exclude_none=True)
        new = []
        for task_name in dict.fromkeys(tasks.values()):
            on_demand = known_tasks[task_name].constraints.on_demand
            for model_name in dict.fromkeys(models.values()):
                config = model_config(self._registry, model_name, variant.decoding)
                new.append(
                    NewJobs(
                        task=task_name,
                        task_version=known_tasks[task_name].version,
                        model_hash=configuration_hash(config, limits),
                        track=tracks[on_demand].id,
                        seeds=seeds,
                        model=model_name,
                        model_config=config,
                        track_config=tracks[on_demand].as_config(),
                        limits=limits,
                    )
                )
        return new

    def _track(self, variant: Variant, on_demand: bool) -> Track:
        workflow, pack = self._workflows[variant.workflow], self._packs.load(variant.prompts)
        loop, simulator = variant.closed_loop, variant.simulator
        worlds = 0 if variant.paper else worlds_here(self._context, simulator, variant.worlds)
        return Track(
            workflow=workflow.name,
            simulator=simulator,
            simulation_version=simulation_version(self._context, simulator),
            prompts=pack.name,
            prompts_digest=pack.digest,
            workflow_digest=workflow.digest,
            one_shot=variant.one_shot,
            rounds=1 if loop is None else loop.rounds,
            analyst=loop is not None and loop.analyst,
            on_demand=on_demand,
            data_sheets=variant.data_sheets,
            worlds=worlds,
            paper=variant.paper,
        )

    def _require_known(
        self,
        variant: Variant,
        tasks: Mapping[str, str],
        models: Mapping[str, str],
        known_tasks: Mapping[str, Task],
    ) -> None:
        if any(name not in known_tasks for name in tasks.values()):
            # All tasks are valid choices.
            known_tasks = self._context.tasks.newest()
        issues = [
            *_unknown("task", tasks, known_tasks),
            *_unknown("model", models, self._registry.models),
            *_unknown("workflow", {"workflow": variant.workflow}, self._workflows),
            *simulator_issues(self._context, variant.simulator),
            *worlds_issues(self._context, variant.simulator, variant.worlds),
            *(_unknown("paper's task", tasks, paper_tasks()) if variant.paper else ()),
            *_unknown("prompt pack", {"prompts": variant.prompts}, self._packs.names),
        ]
        issues = issues or [
            *self._infeasible(variant.workflow, tasks, known_tasks),
            *sampling_issues(
                self._context,
                variant.simulator,
                variant.worlds,
                {path: known_tasks[name] for path, name in tasks.items()},
            ),
        ]
        if issues:
            raise SubmissionError(issues)

    def _infeasible(
        self, workflow: str, tasks: Mapping[str, str], known_tasks: Mapping[str, Task]
    ) -> list[ValidationIssue]:
        """Return an issue for each task that requires something that the workflow never builds."""
        kind = self._workflows[workflow]
        issues = []
        for path, name in tasks.items():
            task = known_tasks[name]
            if not kind.one_structure or task.constraints.min_sub_structures <= 1:
                continue
            message = f"asks for several sub-structures, and the workflow {workflow!r} builds one"
            able = [other for other, flow in self._workflows.items() if not flow.one_structure]
            issues.append(
                ValidationIssue(path=path, message=f"{name} {message}", choices=tuple(sorted(able)))
            )
        return issues

    def _require_size(self, jobs: int) -> None:
        largest = self._context.settings.max_sweep_jobs
        if jobs > largest:
            message = f"the sweep has {jobs:,} jobs; the largest accepted has {largest:,}"
            raise SubmissionError([ValidationIssue(path="seeds", message=message)])


def spec_hash(spec: SweepSpec) -> str:
    """Return the content hash of a submission."""
    return content_hash(spec.model_dump(mode="json", exclude_none=True))


def model_config(registry: ModelRegistry, name: str, decoding: Decoding) -> dict[str, Any]:
    """Return everything about a model that can change its replies."""
    entry = registry.models[name]
    return {
        "name": entry.name,
        "provider": entry.provider,
        "model": entry.model,
        "decoding": decoding.model_dump(exclude_none=True),
    }


def _unknown(kind: str, names: Mapping[str, str], valid: Collection[str]) -> list[ValidationIssue]:
    """Return an issue for each unknown name; names come by their paths."""
    return [
        ValidationIssue(path=path, message=f"unknown {kind} {name!r}", choices=tuple(sorted(valid)))
        for path, name in names.items()
        if name not in valid
    ]
