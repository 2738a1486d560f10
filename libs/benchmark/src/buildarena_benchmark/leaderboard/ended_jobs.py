"""Ended jobs, as input of leaderboards."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from types import MappingProxyType
from typing import Any, Final

from buildarena_benchmark.outcomes import SCORED

_NOTHING: Final[Mapping[str, Any]] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class EndedJob:
    """An ended job.

    Attributes:
        track: Track; trials of different tracks are never compared.
        task_version: Content hash of the task; trials of different versions are never mixed.
        configuration: Hash of model, decoding and limits: the key of a board's row.
        seed: Seed; models tried with the same one can be compared in pairs.
        reason: Class of its failure, if any.
        success: Share of its worlds in which it met the task's criterion, 0 to 1.
        indicator: Mean of the task's indicator over its worlds, 0 where it failed.
        parts: Parts of its machine, if any.
        test_trials: Test trials that its builder used; None for a track without.
        flags: Remarks on its score; see `buildarena_benchmark.flags`.
        refusals: Refused actions by refusal class.
        requests: Model requests; None, as the next three, for an external agent: it reports none.
        actions: Actions, refused ones included.
        ran_on_runner: Whether a runner ran one of its trials.
        unverified: Whether its verification is open or refuted it: it is not counted.
    """

    job_id: str
    task: str
    model: str
    outcome: str
    success: float
    indicator: float
    seed: int = 0
    track: str = ""
    task_version: str = ""
    configuration: str = ""
    decoding: Mapping[str, Any] = field(default_factory=lambda: _NOTHING)
    reason: str | None = None
    parts: int | None = None
    test_trials: int | None = None
    flags: tuple[str, ...] = ()
    refusals: Mapping[str, int] = field(default_factory=lambda: _NOTHING)
    requests: int | None = 0
    input_tokens: int | None = 0
    output_tokens: int | None = 0
    cost_usd: float | None = 0.0
    actions: int = 0
    refused_actions: int = 0
    finished_at: datetime | None = None
    ran_on_runner: bool = False
    unverified: bool = False

    @property
    def gained(self) -> float:
        """Its indicator; 0 for a failure, whatever the trial measured."""
        return self.indicator if self.success else 0.0

    @property
    def scored(self) -> bool:
        """True if the trial counts in averages."""
        return self.outcome in SCORED and not self.unverified
