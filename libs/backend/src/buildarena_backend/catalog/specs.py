"""Submissions: one job, or a sweep over tasks x models x seeds."""

from __future__ import annotations

from decimal import Decimal
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field, StrictInt, ValidationInfo, field_validator

from buildarena_backend.accounts.budgets import BudgetLimits
from buildarena_backend.catalog.workflows import DEFAULT_WORKFLOW
from buildarena_backend.database.text import INVISIBLE
from buildarena_simulation import DEFAULT_ENGINE
from buildarena_simulation.constants import MAX_WORLDS

MAX_SEED = 2**53 - 1
"""Largest seed: every JSON reader keeps integers up to here exact."""

Worlds = Annotated[
    StrictInt | None,
    Field(
        ge=0,
        le=MAX_WORLDS,
        description="Number of varied worlds (position, yaw, cargo offset, key timing) in which a "
        "finished machine is scored besides the exact one. Default: the service's",
    ),
]
Seed = Annotated[StrictInt, Field(ge=0, le=MAX_SEED)]
Name = Annotated[str, Field(min_length=1, max_length=200)]
Title = Annotated[str, Field(min_length=1, max_length=200, pattern=f"^[^{INVISIBLE}]+$")]
"""A label given by a user: one line, of visible characters."""


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class Decoding(BaseModel):
    """Sampling parameters of a model's replies. The defaults are the paper's."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    temperature: Annotated[Number | None, Field(ge=0, le=2)] = 0.5
    top_p: Annotated[Number | None, Field(gt=0, le=1)] = 0.7
    max_tokens: Annotated[StrictInt | None, Field(ge=1, le=1_000_000)] = None


STANDARD_MAX_REQUESTS: Final = 1500
STANDARD_MAX_COST_USD: Final = 10
"""Limits of each job's session on every track. A strong model never meets them."""


class Limits(BaseModel):
    """Limits of one job's session, below those of the standard protocol.

    A job that reaches one ends as ``limit`` and counts nowhere; one that reaches the protocol's own
    has failed.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    max_requests: Annotated[StrictInt | None, Field(ge=1, le=STANDARD_MAX_REQUESTS)] = None
    max_tokens: Annotated[
        StrictInt | None, Field(ge=1, description="Input and output together")
    ] = None
    max_cost_usd: Annotated[Number | None, Field(gt=0, le=STANDARD_MAX_COST_USD)] = None
    max_duration_s: Annotated[Number | None, Field(gt=0)] = None


class Budget(BaseModel):
    """Limits on the total spending of a sweep's or key's jobs; beyond them nothing new starts."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    max_cost_usd: Annotated[Number | None, Field(gt=0, le=10_000_000)] = None
    max_tokens: Annotated[
        StrictInt | None, Field(ge=1, le=MAX_SEED, description="Input and output together")
    ] = None
    max_requests: Annotated[StrictInt | None, Field(ge=1, le=MAX_SEED)] = None

    def as_limits(self) -> BudgetLimits:
        """Return the form that the store keeps."""
        cost = self.max_cost_usd
        return BudgetLimits(
            max_cost_usd=None if cost is None else Decimal(str(cost)),
            max_tokens=self.max_tokens,
            max_requests=self.max_requests,
        )


class ClosedLoop(BaseModel):
    """Further rounds for samples that failed, after reading the simulator's results."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rounds: Annotated[StrictInt, Field(ge=2, le=20, description="The first one included")]
    analyst: Annotated[
        bool, Field(description="An analyst looks at each failure and advises the next round")
    ] = False


class Variant(BaseModel):
    """The options that make a track, and the limits of its sessions."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    workflow: Name = DEFAULT_WORKFLOW
    simulator: Name = DEFAULT_ENGINE
    prompts: Name = "default"
    data_sheets: Annotated[
        bool,
        Field(
            description="Include module and world parameters in the prompt. If false, models "
            "determine them by trials"
        ),
    ] = True
    worlds: Worlds = None
    paper: Annotated[
        bool,
        Field(
            description="The paper's protocol: its nine tasks in the exact world alone, without "
            "test trials and limits; trials that the paper calls hacked are left out"
        ),
    ] = False
    one_shot: Annotated[bool, Field(description="Show an example construction")] = False
    closed_loop: ClosedLoop | None = None
    decoding: Decoding = Decoding()
    limits: Limits = Limits()

    @field_validator("paper")
    @classmethod
    def _has_no_worlds(cls, paper: bool, info: ValidationInfo) -> bool:
        if paper and info.data.get("worlds"):
            raise ValueError("the paper's protocol has no varied worlds: leave `worlds` out")
        return paper


class JobSpec(Variant):
    """A job: a task, a model and a seed."""

    task: Name
    model: Name
    seed: Seed = 0


class SweepSpec(Variant):
    """A matrix of jobs: every task with every model and every seed."""

    name: Title = "sweep"
    tasks: Annotated[list[Name], Field(min_length=1, max_length=1000)]
    models: Annotated[list[Name], Field(min_length=1, max_length=1000)]
    seeds: Annotated[list[Seed] | None, Field(min_length=1, max_length=100_000)] = None
    samples: Annotated[
        StrictInt | None, Field(ge=1, le=100_000, description="Seeds 0 … samples-1")
    ] = None
    budget: Budget | None = None

    @field_validator("samples")
    @classmethod
    def _seeds_or_samples(cls, samples: int | None, info: ValidationInfo) -> int | None:
        if info.data.get("seeds") is not None:
            raise ValueError("give either seeds or samples, not both")
        return samples

    def all_seeds(self) -> list[int]:
        """Return the seeds, each once, in their order; the paper's 64 samples by default."""
        if self.seeds is not None:
            return list(dict.fromkeys(self.seeds))
        return list(range(64 if self.samples is None else self.samples))
