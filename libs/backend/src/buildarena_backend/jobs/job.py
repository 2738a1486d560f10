"""A job as a value: one task x model x seed on one track, and everything known about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from decimal import Decimal
from functools import cached_property
from typing import Annotated, Any, Final

from pydantic import Field, with_config

from buildarena_backend.database.rows import columns_of
from buildarena_backend.database.tables import jobs
from buildarena_backend.ids import content_hash
from buildarena_backend.states import EXTERNAL_PROVIDER

USE: Final = (
    *("requests", "input_tokens", "output_tokens", "cost_usd"),
    *("cached_tokens", "reasoning_tokens"),
)


def configuration_hash(model_config: Mapping[str, Any], limits: Mapping[str, Any]) -> str:
    """Return the content hash of a model's configuration and of the limits of its session, if any.

    Limits can change a result as much as decoding can: a job with other limits is another job, and
    another row of a leaderboard.
    """
    return content_hash({**model_config, "limits": dict(limits)} if limits else model_config)


@dataclass(frozen=True, kw_only=True)
class NewJobs:
    """Jobs to be added that differ in their seeds alone; names are those of `Job`.

    Attributes:
        model_hash: `configuration_hash` of the model, its decoding and the jobs' limits.
        owner: Id of the API key that submits them, if any.
        payer: Id of the sweep whose budget pays for them, if any.
        traceparent: The span of their submission, by W3C's Trace Context, if there is one.
    """

    task: str
    task_version: str
    model_hash: str
    track: str
    seeds: Sequence[int]
    model: str
    model_config: Mapping[str, Any]
    track_config: Mapping[str, Any]
    limits: Mapping[str, Any] = field(default_factory=dict)
    owner: str | None = None
    payer: str | None = None
    traceparent: str | None = None

    @cached_property
    def job_ids(self) -> list[str]:
        """Their ids, in the order of the seeds: the same job has the same id everywhere."""
        key = self.task, self.task_version, self.model_hash, self.track
        return ["job_" + content_hash([*key, seed])[:20] for seed in self.seeds]


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A job's row. Times are in UTC; names are those of the columns.

    `randomization_seed` seeds parameters hidden from its builder: no response may have it during
    the job.
    """

    id: str
    task: str
    task_version: str
    model: str
    model_hash: str
    model_config: Mapping[str, Any]
    track: str
    track_config: Mapping[str, Any]
    seed: int
    randomization_seed: int | None
    limits: Mapping[str, Any]
    owner: str | None
    payer: str | None
    traceparent: str | None
    stage: str
    queue: str
    state: str
    outcome: str | None
    reason: str | None
    detail: str | None
    faults: int
    lease_owner: str | None
    lease_token: int
    success: float | None
    indicator: float | None
    metrics: Mapping[str, Any] | None
    flags: Sequence[str] | None
    manifest: Mapping[str, Any] | None
    requests: int
    input_tokens: int
    output_tokens: int
    cached_tokens: int
    reasoning_tokens: int
    cost_usd: Decimal
    actions: int
    refused_actions: int
    refusals: Mapping[str, int] | None
    ran_on_runner: bool
    audit: str | None
    verified_at: datetime | None
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None

    @property
    def usage_is_known(self) -> bool:
        """True if its requests, tokens and cost were counted: an external agent reports none."""
        return self.model_config.get("provider") != EXTERNAL_PROVIDER

    @property
    def usage(self) -> Mapping[str, Any]:
        """Its requests, tokens and cost; each None where they were not counted."""
        known = self.usage_is_known
        return {name: getattr(self, name) if known else None for name in USE}


@with_config(use_attribute_docstrings=True)
@dataclass(frozen=True, slots=True, kw_only=True)
class Artifact:
    """An artifact of a job."""

    name: Annotated[str, Field(examples=["trajectory-0"])]
    media_type: Annotated[str, Field(examples=["application/vnd.apache.parquet"])]
    size: int
    """Bytes."""
    sha256: str
    """Hash of the bytes."""


JOB_COLUMNS = columns_of(Job, jobs)
