"""What the API answers with."""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime
from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from buildarena_backend.accounts.budgets import Budget
from buildarena_backend.jobs.job import Job
from buildarena_backend.states import AttemptResult, Audit, JobState, Outcome, Stage, SweepState
from buildarena_backend.sweeps.sweeps import SweepProgress
from buildarena_benchmark.flags import is_censored

# Spelled out, because the contract lists the values in place.
AnyOutcome = Literal[
    Outcome.SUCCESS,
    Outcome.UNSUCCESSFUL,
    Outcome.CONSTRUCTION_FAILED,
    Outcome.LIMIT,
    Outcome.ERRORED,
    Outcome.CANCELLED,
]
AnyJobState = Literal[JobState.QUEUED, JobState.ON_HOLD, JobState.RUNNING, JobState.DONE]
AnyStage = Literal[Stage.CONSTRUCT, Stage.SIMULATE]
DONE: Final = "done"
"""The state that is shown of an active sweep whose jobs have all ended."""
AnySweepState = Literal[
    SweepState.ACTIVE,
    SweepState.PAUSED,
    SweepState.BUDGET_EXHAUSTED,
    SweepState.CANCELLED,
    "done",
]


class _Answer(BaseModel):
    model_config = ConfigDict(from_attributes=True)


class UsageView(_Answer):
    """What a job's session used; null where an external agent reports nothing."""

    requests: int | None
    input_tokens: int | None
    output_tokens: int | None
    cached_tokens: int | None
    reasoning_tokens: int | None
    cost_usd: float | None

    @staticmethod
    def of(job: Job) -> UsageView:
        """What is known of a job's usage."""
        if job.usage_is_known:
            return UsageView.model_validate(job)
        return UsageView.model_validate(dict.fromkeys(UsageView.model_fields))


class AttemptView(_Answer):
    """One worker's attempt at a job's stage."""

    token: int = Field(description="Fencing token: grows with every attempt")
    stage: str
    worker: str
    started_at: datetime
    ended_at: datetime | None
    result: str | None = Field(description=", ".join(AttemptResult))
    detail: str | None


class JobView(_Answer):
    """A job: one task x model x seed on one track."""

    id: str = Field(examples=["job_5f2b0c8e4d1a9b7c3e60"])
    task: str = Field(examples=["support-1"])
    task_version: str
    model: str = Field(examples=["builtin/expert"])
    configuration: str = Field(description="Hash of model, decoding and limits")
    track: str
    seed: int
    owner: str | None = Field(description="Id of the API key that submitted it")
    state: AnyJobState
    stage: AnyStage
    outcome: AnyOutcome | None = Field(description="How it ended; null until it has")
    reason: str | None = Field(description="Class of the failure, if any")
    detail: str | None
    success: bool | None
    indicator: float | None = Field(description="The task's performance indicator")
    censored: bool = Field(description="Whether the indicator is at least what it says")
    metrics: dict[str, Any] | None
    flags: list[str] | None = Field(description="Remarks on the score; the board says what of")
    usage: UsageView
    actions: int
    refused_actions: int
    refusals: dict[str, int] | None = Field(description="Refused actions by class")
    faults: int = Field(description="Infrastructure faults at the current stage")
    by_runner: bool = Field(description="Whether a runner ran one of its trials")
    audit: Literal[Audit.REQUIRED, Audit.VERIFIED, Audit.REFUTED] | None = Field(
        description="Of a score that was brought by a runner, or refuted: it counts once "
        "it is verified, and nowhere while a verification is required or refuted it"
    )
    verified_at: datetime | None = Field(description="When such a score was verified")
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None

    @staticmethod
    def of(job: Job) -> JobView:
        """The view of a job."""
        return JobView.model_validate(
            {
                **{name: getattr(job, name, None) for name in JobView.model_fields},
                "configuration": job.model_hash,
                "censored": is_censored(job.flags or ()),
                "usage": UsageView.of(job),
            }
        )


class JobDetail(JobView):
    """A job with its manifest, attempts and artifacts."""

    manifest: dict[str, Any] | None = Field(description="Versions of what can change the score")
    attempts: list[AttemptView]
    artifacts: dict[str, str] = Field(description="SHA-256 of each artifact by name")


class JobFileView(_Answer):
    """An artifact of a job."""

    name: str = Field(examples=["trajectory-0"])
    media_type: str = Field(examples=["application/vnd.apache.parquet"])
    size: int = Field(description="Bytes")
    hash: str = Field(description="SHA-256 of the bytes")


class JobPage(_Answer):
    """Some jobs, in the order that was asked for."""

    jobs: list[JobView]
    next_cursor: str | None = Field(description="Give it as `cursor` to get the next page")


class EndingView(_Answer):
    """Jobs that stand or ended alike."""

    state: AnyJobState
    outcome: AnyOutcome | None = Field(description="null while they have not ended")
    reason: str | None = Field(description="Class of the failure")
    jobs: int


class PromptView(_Answer):
    """What a role was told before a turn."""

    turn: int | None = Field(description="Place in the transcript; null for a reply in no turn")
    system: str | None = Field(description="The role's system message, before its first turn")
    user: list[str] = Field(description="Further messages, in order")


class PromptsView(_Answer):
    """What a session told its roles."""

    prompts: list[PromptView] = Field(description="In order; turns that were told nothing lack")


class JobSummaryView(_Answer):
    """What a list of jobs comes to."""

    jobs: int
    all_counted: bool = Field(description="false when there are more than were counted")
    endings: list[EndingView] = Field(description="The most frequent first")
    flags: dict[str, int] = Field(description="Jobs with each flag, the most frequent first")


LOST: Final = (
    "Requests whose replies may have been paid for and are in no journal: the process that sent "
    "them was killed, or their lease had ended"
)


class ProgressView(_Answer):
    """Progress of a sweep."""

    total: int
    done: int
    stages: dict[str, int] = Field(
        description="Jobs that have not ended, by stage and state",
        examples=[{"construct running": 2}],
    )
    outcomes: dict[str, int] = Field(description="Ended jobs by outcome", examples=[{"success": 4}])
    requests: int
    lost_requests: int = Field(default=0, description=LOST)
    input_tokens: int
    output_tokens: int
    cost_usd: float

    @staticmethod
    def of(progress: SweepProgress) -> ProgressView:
        """The view of a sweep's progress."""
        return ProgressView.model_validate(progress)


class BudgetView(_Answer):
    """What may be spent, and what was."""

    max_cost_usd: float | None
    max_tokens: int | None
    max_requests: int | None
    spent_cost_usd: float
    spent_tokens: int
    spent_requests: int
    lost_cost_usd: float = Field(
        default=0.0, description="What the lost requests cost at most, beyond what was spent"
    )
    lost_requests: int = Field(default=0, description=LOST)

    @staticmethod
    def of(budget: Budget | None) -> BudgetView | None:
        """The view of a budget, if there is one."""
        if budget is None:
            return None
        return BudgetView.model_validate(asdict(budget) | asdict(budget.limits))


class SweepView(_Answer):
    """A sweep with its progress."""

    id: str = Field(examples=["sweep_0a1b2c3d4e5f60718293"])
    name: str
    state: AnySweepState = Field(
        description="budget_exhausted when a budget is used up; done when every job has ended"
    )
    owner: str | None = Field(description="Id of the API key that submitted it")
    created_at: datetime
    spec: dict[str, Any]
    budget: BudgetView | None
    progress: ProgressView
    last_event: int = Field(
        description="What later requests answer holds every event up to this one: whoever has "
        "read the jobs gives it as `Last-Event-ID` and hears only what happened since"
    )


class ForecastView(_Answer):
    """What is to come of a sweep, from what ran so far."""

    jobs_left: int = Field(description="Jobs that have not ended")
    jobs_per_minute: float | None = Field(
        description="How fast jobs are scored, over the last hundred; null until five were, and "
        "unless the sweep is active"
    )
    ends_at: datetime | None = Field(description="When the last one ends at that rate")
    cost_usd_left: float = Field(
        description="What the jobs left come to cost yet, by the mean cost of the same model on "
        "the same task, or on other tasks"
    )
    cost_usd_total: float = Field(description="The same with what was spent")
    budget_usd_short: float | None = Field(
        description="How many dollars the budget lacks for that; null when it has no limit in "
        "dollars, 0 when it is enough"
    )
    unknown_models: list[str] = Field(
        description="Models of which no job has been scored yet: the costs leave them out"
    )


class TroubleView(_Answer):
    """Attempts at a sweep's jobs that failed alike; faults never count as failures of a model."""

    model: str
    stage: AnyStage
    result: Literal[AttemptResult.FAULT, AttemptResult.LOST]
    detail: str | None = Field(description="A sentence for people")
    attempts: int
    jobs: int = Field(description="Of how many jobs")
    newest: datetime = Field(description="When the last one ended")


class SweepAccepted(_Answer):
    """A sweep that was accepted."""

    id: str
    jobs: int = Field(description="Jobs it consists of")
    added: int = Field(description="Jobs that are new; the others had been submitted before")
    resumed: bool = Field(
        default=False, description="Whether an earlier submission of the same jobs was resumed"
    )


class ModelEstimate(_Answer):
    """What one model's part of a sweep would use."""

    model: str
    jobs: int
    requests: float
    input_tokens: float
    output_tokens: float
    cost_usd: float | None = Field(description="null when no price is known")


class BoardPower(_Answer):
    """What a sweep's board could show, where the weaker model succeeds in half of its trials."""

    trials: int = Field(description="Trials of each model on each task")
    on_a_task: float | None = Field(
        description="The smallest rise of the success rate, 0 to 1, that four of five such boards "
        "claim on one task; null when they claim none"
    )
    overall: float | None = Field(description="The same rise on every task, over all of them")
    trials_for_ten_points: int = Field(
        description="Trials of each model on each task that show a rise of 0.1 over all tasks"
    )


class SweepEstimate(_Answer):
    """What a sweep would consist of, from the mean figures that the paper reports per task."""

    jobs: int
    models: list[ModelEstimate]
    cost_usd: float = Field(description="Sum over the models with a known price")
    power: BoardPower


class SweepPage(_Answer):
    """Some sweeps, newest first."""

    sweeps: list[SweepView]
    next_cursor: str | None
