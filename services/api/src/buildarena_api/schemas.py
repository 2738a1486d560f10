"""Response models of the API."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Final, Literal

from fastapi import Response
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, computed_field

from buildarena_backend.jobs.attempts import Attempt
from buildarena_backend.states import Audit, JobState, Outcome, Stage, SweepState
from buildarena_benchmark.flags import is_censored
from buildarena_benchmark.statistics import BoardPower


class View(BaseModel):
    """Base of response models; the text below a field is its description in the contract."""

    model_config = ConfigDict(
        from_attributes=True,
        use_attribute_docstrings=True,
        json_schema_serialization_defaults_required=True,
    )


class Document(BaseModel):
    """Base of request models; unknown fields are refused."""

    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)


EXISTED: Final[dict[int | str, dict[str, Any]]] = {
    200: {"description": "An equal one was there; 201: it is new"}
}
"""Responses of operations that create something, unless it exists."""


def tell_created(response: Response, path: str, *, is_new: bool) -> None:
    """Answer with the path of what a request created, or of the equal one that exists."""
    response.status_code = 201 if is_new else 200
    response.headers["Location"] = path


Flags = Annotated[list[str], BeforeValidator(lambda flags: flags or [])]
Censored = Annotated[bool, BeforeValidator(lambda flags: is_censored(flags or ()))]
Counts = Annotated[dict[str, int], BeforeValidator(lambda counts: counts or {})]


class UsageView(View):
    """Model requests with their use; null for external agents, which report none."""

    requests: int | None
    input_tokens: int | None
    output_tokens: int | None
    cost_usd: float | None


class JobView(View):
    """A job: one task x model x seed on one track."""

    # A detail of a job is made of its view too.
    model_config = ConfigDict(validate_by_name=True)

    id: str = Field(examples=["job_5f2b0c8e4d1a9b7c3e60"])
    task: str = Field(examples=["support-1"])
    task_version: str
    model: str = Field(examples=["builtin/expert"])
    configuration: str = Field(validation_alias="model_hash")
    """Hash of model, decoding and limits."""
    track: str
    seed: int
    key_id: str | None = Field(validation_alias="owner")
    """Id of the API key that submitted it."""
    state: JobState
    stage: Stage
    outcome: Outcome | None
    """Its outcome; null until it has ended."""
    reason: str | None
    """Class of the failure, if any."""
    detail: str | None
    success: float | None
    """Share of its worlds that it passed, 0 to 1."""
    indicator: float | None
    """The task's indicator, as a mean over its worlds; 0 where it failed."""
    censored: Censored = Field(validation_alias="flags")
    """Whether the indicator is a lower bound."""
    metrics: Annotated[dict[str, Any], BeforeValidator(lambda metrics: metrics or {})]
    flags: Flags
    """Remarks on the score."""
    usage: UsageView
    actions: int
    refused_actions: int
    refusals: Counts
    """Refused actions by class."""
    faults: int
    """Infrastructure faults at the current stage."""
    ran_on_runner: bool
    """Whether a runner ran one of its trials."""
    verification_status: Audit | None = Field(validation_alias="audit")
    """State of a score that a runner submitted or a verification refuted: it counts once it is
    verified."""
    verified_at: datetime | None
    """Time of that verification."""
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None


class WorldView(View):
    """A trial that a job is scored by: in the exact world, or in a varied one."""

    rollout: int
    """Number of its trajectory and scene."""
    exact: bool
    """Whether it is the world known to builders."""
    success: bool
    """Whether it passed, and no flag disqualifies it."""
    indicator: float
    """The task's indicator, whether it passed or not."""
    flags: list[str]
    explanation: str
    """Explanation of the result, with the distance to success."""


class JobDetail(JobView):
    """A job with its manifest, attempts and artifacts."""

    test_trials: int
    """Test trials used, which do not count."""
    explanation: str | None
    """Explanation of the result in words, with the distance to success; null until it has ended."""
    worlds: list[WorldView]
    """Trials whose mean is the score; the exact world's first."""
    manifest: dict[str, Any] | None
    """Versions of what can change the score."""
    attempts: list[Attempt]
    retries: dict[str, int]
    """Requests that were sent again, by what failed."""
    artifacts: dict[str, str]
    """SHA-256 of each artifact by name."""
    cached_tokens: int | None
    """Part of the input that was in the provider's cache."""
    reasoning_tokens: int | None
    """Part of the output that was hidden reasoning."""


class PromptView(View):
    """Messages to a role before a turn."""

    turn: int | None
    """Place in the transcript; null for a reply in no turn."""
    system: str | None
    """The role's system message, before its first turn."""
    user: list[str]
    """Further messages, in order."""


LOST: Final = (
    "Requests whose replies may have been paid for and are in no journal: the process that sent "
    "them was killed, or their lease had ended"
)


class ProgressView(View):
    """Progress of a sweep."""

    total: int
    done: int
    stages: dict[str, int] = Field(examples=[{"construct running": 2}])
    """Jobs that have not ended, by stage and state."""
    outcomes: dict[str, int] = Field(examples=[{"success": 4}])
    """Ended jobs by outcome."""
    usage: UsageView
    lost_requests: int = Field(description=LOST)


class BudgetUse(View):
    """Limits, use and remainder of a budget; null means no limit."""

    max_cost_usd: float | None
    max_tokens: int | None
    max_requests: int | None
    used_cost_usd: float = Field(validation_alias="spent_cost_usd")
    used_tokens: int = Field(validation_alias="spent_tokens")
    used_requests: int = Field(validation_alias="spent_requests")
    lost_cost_usd: float
    """Upper bound of the cost of lost requests, in addition to what was used."""
    lost_requests: int = Field(description=LOST)

    @computed_field
    def remaining_cost_usd(self) -> float | None:
        """Return the remainder."""
        limit = self.max_cost_usd
        return None if limit is None else max(0.0, round(limit - self.used_cost_usd, 6))

    @computed_field
    def remaining_tokens(self) -> int | None:
        """Return the remainder."""
        return None if self.max_tokens is None else max(0, self.max_tokens - self.used_tokens)

    @computed_field
    def remaining_requests(self) -> int | None:
        """Return the remainder."""
        limit = self.max_requests
        return None if limit is None else max(0, limit - self.used_requests)


class SweepView(View):
    """A sweep with its progress."""

    id: str = Field(examples=["sweep_0a1b2c3d4e5f60718293"])
    name: str
    state: SweepState
    """budget_exhausted when a budget is used up; done when every job has ended."""
    key_id: str | None
    """Id of the API key that submitted it."""
    created_at: datetime
    spec: dict[str, Any] = Field(title="Specification")
    """The submitted specification."""
    budget: BudgetUse | None
    progress: ProgressView
    last_event: int
    """Later responses include every event up to this one: after reading the jobs, send it as
    `Last-Event-ID` to receive only newer events."""


class SweepFaultView(View):
    """Attempts or requests that failed alike, or hang; they never count against a model."""

    model: str
    stage: Stage
    result: Literal["fault", "lost", "retried", "waiting"]
    """Result of the attempts; `retried`: requests that were sent again; `waiting`: requests without
    an answer for a minute."""
    detail: str | None
    """A sentence for people."""
    attempts: int
    """Attempts, or requests."""
    jobs: int
    """Number of jobs."""
    last_at: datetime = Field(validation_alias="newest")
    """End of the last one; of requests, since when they wait."""


class SweepAccepted(View):
    """A sweep that was accepted."""

    id: str
    jobs: int
    """Jobs it consists of."""
    added: int
    """Jobs that are new; the others had been submitted before."""
    resumed: bool = False
    """Whether an earlier submission of the same jobs was resumed."""


class ModelEstimate(View):
    """Estimated use of one model's part of a sweep."""

    model: str
    jobs: int
    usage: UsageView
    """cost_usd is null when no price is known."""


class SweepEstimate(View):
    """Estimate of a sweep from the paper's mean figures per task."""

    jobs: int
    models: list[ModelEstimate]
    cost_usd: float
    """Sum over the models with a known price."""
    max_cost_usd: float | None
    """Upper bound by the jobs' limits and the sweep's budget, built-in models free; null without a
    limit."""
    power: BoardPower
