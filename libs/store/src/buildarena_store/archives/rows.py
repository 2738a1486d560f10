"""What the rows of an archive may hold: the API's rules for what people send, and the tables' own.

Each class has the columns of one table. Values that belong to another service (owners, payers,
leases, marks) are taken out here.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import Annotated, Any, Final, Self

from pydantic import AfterValidator, AwareDatetime, BaseModel, ConfigDict, Field, model_validator

from buildarena_benchmark import TaskError, parse_task
from buildarena_benchmark.outcomes import SCORED
from buildarena_benchmark.tasks.sources import MAX_BYTES
from buildarena_geometry.json_values import levels
from buildarena_store.artifacts.kinds import MEDIA_TYPES, NAME
from buildarena_store.jobs.job import JobKey, configuration_hash
from buildarena_store.states import Audit, JobState, Outcome, Stage, SweepState

DEEPEST: Final = 64
LARGEST_COUNT: Final = 2**53 - 1
AHEAD: Final = timedelta(minutes=5)
"""How far another service's clock may be ahead of ours."""


def _plain(value: Any) -> Any:
    """A JSON value of bounded depth, whose numbers are finite and whose texts can be stored."""
    for depth, level in enumerate(levels(value)):
        if depth > DEEPEST:
            raise ValueError(f"nested deeper than {DEEPEST}")
        for item in level:
            _require_storable(item)
            if isinstance(item, dict):
                for key in item:
                    _require_storable(key)
    return value


def _require_storable(value: object) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{value} is not a finite number")
    if isinstance(value, int) and abs(value) > LARGEST_COUNT:
        raise ValueError("a whole number beyond 2**53")
    if isinstance(value, str) and "\0" in value:
        raise ValueError("a text with a NUL character")
    if isinstance(value, str) and any("\ud800" <= character <= "\udfff" for character in value):
        raise ValueError("a text with half a surrogate pair")


def _past(value: datetime) -> datetime:
    if value > datetime.now(UTC) + AHEAD:
        raise ValueError("is in the future")
    return value


def _told(value: dict[str, Any]) -> dict[str, Any]:
    """What a session told a role: a system message and others, all texts."""
    texts = [
        value.get("system", ""),
        *(value["user"] if isinstance(value.get("user"), list) else [0]),
    ]
    if not set(value) <= {"system", "user"} or not all(isinstance(text, str) for text in texts):
        raise ValueError("what a role was told is a system message and a list of others")
    _plain(value)
    return value


Json = Annotated[Any, AfterValidator(_plain)]
JsonObject = Annotated[dict[str, Any], AfterValidator(_plain)]
Told = Annotated[dict[str, Any], AfterValidator(_told)]
JsonList = Annotated[list[Any], AfterValidator(_plain)]
Time = Annotated[AwareDatetime, AfterValidator(_past)]
Count = Annotated[int, Field(ge=0, le=LARGEST_COUNT)]
Cost = Annotated[Decimal, Field(ge=0, max_digits=14, decimal_places=6)]
Figure = Annotated[float, Field(allow_inf_nan=False)]
JobId = Annotated[str, Field(pattern=r"^job_[0-9a-f]{20}$")]
SweepId = Annotated[str, Field(pattern=r"^sweep_[0-9a-f]{20}$")]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Version = Annotated[str, Field(pattern=r"^[0-9a-f]{12}$")]
Word = Annotated[str, Field(pattern=r"^[a-z0-9]+([-_.][a-z0-9]+)*$", max_length=60)]
Line = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f]+$", min_length=1, max_length=500)]
"""One line of characters that can be stored."""
Prose = Annotated[str, Field(pattern=r"^[^\x00]*$", max_length=100_000)]
Words = dict[Word, Count]


class _Row(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class ManifestFile(BaseModel):
    """What an archive says of itself."""

    model_config = ConfigDict(extra="ignore", strict=True)

    format: int
    schema_version: Line = Field(alias="schema")
    buildarena: Line
    sweep: SweepId
    written_at: Time


class SweepRow(_Row):
    """A sweep."""

    id: SweepId
    name: Annotated[Line, Field(max_length=200)]
    spec: JsonObject
    state: Annotated[SweepState, Field(strict=False)]
    owner: str | None
    request_key: str | None
    request_hash: Digest | None
    jobs_hash: Digest | None
    created_at: Time


class JobRow(_Row):
    """A job, whose id and configuration must be those of its other columns."""

    id: JobId
    task: Word
    task_version: Version
    model: Annotated[Line, Field(max_length=200)]
    model_hash: Digest
    model_config_: JsonObject = Field(alias="model_config")
    track: Line
    track_config: JsonObject
    seed: Count
    draw: Count | None = None
    limits: dict[Word, Annotated[Figure, Field(gt=0)] | Annotated[int, Field(gt=0)]]
    owner: str | None
    payer: str | None
    stage: Annotated[Stage, Field(strict=False)]
    queue: Annotated[str, Field(pattern=r"^(construct|external|simulate\.[a-z0-9]+)$")]
    state: Annotated[JobState, Field(strict=False)]
    outcome: Annotated[Outcome | None, Field(strict=False)]
    reason: Word | None
    detail: Prose | None
    faults: Annotated[int, Field(ge=0, le=10_000)]
    lease_owner: str | None
    lease_token: Count
    lease_expires_at: AwareDatetime | None
    available_at: AwareDatetime | None
    notified_at: AwareDatetime | None
    success: bool | None
    indicator: Figure | None
    metrics: JsonObject | None
    flags: list[Word] | None
    manifest: JsonObject | None
    requests: Count
    lost_requests: Count = 0
    input_tokens: Count
    output_tokens: Count
    cached_tokens: Count
    reasoning_tokens: Count
    cost_usd: Cost
    actions: Count
    refused_actions: Count
    refusals: Words | None
    imported_from: Prose | None
    by_runner: bool = False
    audit: Annotated[Audit | None, Field(strict=False)] = None
    verified_at: AwareDatetime | None
    created_at: Time
    started_at: Time | None
    finished_at: Time | None

    @model_validator(mode="after")
    def _is_itself(self) -> Self:
        key = JobKey(**{name: getattr(self, name) for name in JobKey.__dataclass_fields__})
        if self.id != key.job_id:
            raise ValueError(f"job {self.id} does not match its id: it was changed")
        if self.model_hash != configuration_hash(self.model_config_, self.limits):
            raise ValueError("model_hash is not that of the model's configuration and limits")
        if self.model_config_.get("name") != self.model:
            raise ValueError("model is not the name in its configuration")
        return self

    @model_validator(mode="after")
    def _ended_as_it_says(self) -> Self:
        ended, scored = self.state == JobState.DONE, self.outcome in SCORED
        if ended != (self.outcome is not None) or ended != (self.finished_at is not None):
            raise ValueError("a job has an outcome and an end when it is done, and only then")
        if scored != (self.success is not None) or scored != (self.indicator is not None):
            raise ValueError("a job has a score when its outcome is scored, and only then")
        if scored and self.success != (self.outcome == Outcome.SUCCESS):
            raise ValueError("success and outcome differ")
        if self.refused_actions > self.actions:
            raise ValueError("more actions were refused than made")
        return self

    def values(self) -> dict[str, Any]:
        """The columns, by their names."""
        return self.model_dump(by_alias=True)


class TaskRow(_Row):
    """A version of a custom task, which its text must be."""

    name: Word
    version: Version
    document: Annotated[str, Field(max_length=MAX_BYTES)]
    owner: str | None
    created_at: Time

    @model_validator(mode="after")
    def _is_itself(self) -> Self:
        try:
            task = parse_task(self.document, origin=self.name)
        except TaskError as error:
            raise ValueError(str(error)) from error
        if (task.name, task.version) != (self.name, self.version):
            raise ValueError(f"its text is {task.name} version {task.version}")
        return self


class AttemptRow(_Row):
    """An attempt."""

    job_id: JobId
    token: Count
    stage: Annotated[Stage, Field(strict=False)]
    worker: Line
    started_at: Time
    ended_at: Time | None
    result: Word | None
    detail: Prose | None


class JournalRow(_Row):
    """A model request and its reply; who paid for it is another service's matter."""

    job_id: JobId
    sequence: Count
    token: Count
    stage: Line
    role: Line
    request_hash: Digest
    reply: JsonObject
    input_tokens: Count
    output_tokens: Count
    cached_tokens: Count
    reasoning_tokens: Count
    cost_usd: Cost
    latency_s: Annotated[Figure, Field(ge=0)]
    tries: Annotated[int, Field(ge=1, le=10_000)]
    provider_request_id: Line | None
    payer: Annotated[str | None, AfterValidator(lambda _: None)]
    owner: Annotated[str | None, AfterValidator(lambda _: None)]
    created_at: Time
    told: Told | None = None


class ExternalCallRow(_Row):
    """A tool call of an external agent."""

    job_id: JobId
    sequence: Annotated[int, Field(ge=0, le=10_000)]
    machine: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")]
    tool: Annotated[Prose, Field(max_length=100)]
    arguments: Json
    ok: bool
    reason: Word | None
    feedback: Prose
    at: Time


class RolloutRow(_Row):
    """A simulation; what came of it here is nobody's word yet."""

    job_id: JobId
    number: Annotated[int, Field(ge=0, le=10_000)]
    final: bool
    engine: Word
    machine_hash: Digest
    controls: JsonList | None
    seed: Annotated[int | None, Field(ge=0, lt=2**31)] = None
    success: bool | None
    indicator: Figure | None
    metrics: JsonObject | None
    flags: list[Word] | None
    trajectory_hash: Digest | None
    trace: JsonList | None
    versions: JsonObject | None
    annotations: JsonObject | None = None
    wall_s: Annotated[Figure | None, Field(ge=0)]
    runner: Annotated[str | None, AfterValidator(lambda _: None)] = None
    audited: Annotated[bool, AfterValidator(lambda _: True)] = True
    created_at: Time
    finished_at: Time | None


class ArtifactRow(_Row):
    """What is known of an artifact's bytes."""

    hash: Digest
    media_type: str
    size: Count
    created_at: Time

    @model_validator(mode="after")
    def _is_known(self) -> Self:
        if self.media_type not in MEDIA_TYPES:
            raise ValueError(
                f"media_type {self.media_type[:100]!r}; choose from {', '.join(MEDIA_TYPES)}"
            )
        return self


class JobArtifactRow(_Row):
    """An artifact's name in a job."""

    job_id: JobId
    name: Annotated[str, Field(pattern=NAME)]
    hash: Digest
