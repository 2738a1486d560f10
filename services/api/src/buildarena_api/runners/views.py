"""Requests and responses of runners."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from buildarena_api.schemas import Document, View
from buildarena_backend.artifacts.kinds import EVIDENCE_NAME
from buildarena_backend.artifacts.uploads import MAX_LEASE_FILES
from buildarena_backend.settings import SimulatorName
from buildarena_backend.trials.trials import FaultReason
from buildarena_geometry.json_texts import write_json
from buildarena_simulation import ALL_ENGINES

LONGEST_WAIT_S: Final = 25.0
MAX_VERSIONS: Final = 32
MAX_VERSIONS_BYTES: Final = 4096
MAX_VERSIONS_DEPTH: Final = 2


def _small(facts: dict[str, Any]) -> dict[str, Any]:
    size = len(write_json(facts, MAX_VERSIONS_DEPTH))
    if size > MAX_VERSIONS_BYTES:
        raise ValueError(f"it has {size:,} bytes of JSON, of {MAX_VERSIONS_BYTES:,} at most")
    return facts


Finite = Annotated[float, Field(allow_inf_nan=False)]
Facts = Annotated[
    dict[Annotated[str, Field(max_length=60)], Any],
    Field(max_length=MAX_VERSIONS, description=f"At most {MAX_VERSIONS_BYTES:,} bytes of JSON"),
    AfterValidator(_small),
]
Version = Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]{1,80}$")]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", description="64 hex digits")]


RunnerName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$")]


class RunnerReport(Document):
    """Description of a runner by itself."""

    name: Annotated[RunnerName, Field(examples=["lab3-4711-0"])]
    """Unique among the key's runners: it has one lease at a time."""
    simulators: Annotated[
        dict[SimulatorName, Version], Field(min_length=1, max_length=8, examples=[{"mujoco": "3"}])
    ]
    """The simulators that it has, each with its version: only jobs that were submitted for this
    version are leased to it."""
    versions: Facts = Field(default={})
    pid: Annotated[int, Field(ge=0, le=2**31 - 1)] = 0
    peak_memory_bytes: Annotated[int, Field(ge=0, le=2**50)] | None = None
    reported_at: datetime | None = None
    """Its clock, for the check of clocks in /v1/health."""


class LeaseRequest(RunnerReport):
    """A request for a trial."""

    wait_s: Annotated[float, Field(ge=0, le=LONGEST_WAIT_S)] = 0.0
    """Maximum wait for a trial."""


class RunnerTerms(View):
    """Terms for a runner before it begins."""

    simulators: list[str]
    """Simulators whose jobs the key may lease."""
    versions: dict[str, str]
    """The versions for which the service takes jobs, by simulator."""
    lease_s: float
    """Time after its last heartbeat at which a lease ends."""
    max_file_bytes: int
    """Largest file that can be uploaded."""
    max_lease_bytes: int
    """Most bytes that are uploaded under one lease."""


class LeasedTrial(View):
    """A trial that was leased: all that is needed to run it."""

    job_id: str
    token: int
    """The fencing token, which names the lease with the job."""
    lease_s: float
    """The lease ends this long after its last heartbeat."""
    simulator: str
    version: str
    """The simulator's version that the job was submitted for."""
    number: int
    """Number of the rollout within the job."""
    task: dict[str, Any]
    """The task's document, with its scenario."""
    machine: dict[str, Any]
    """The machine document."""
    controls: list[dict[str, Any]] | None
    """Key presses of this trial; null for the machine's own."""
    seed: int | None
    """Seed of the varied world; null for the exact one."""


class HeldLease(Document):
    """A lease that a runner believes it has."""

    job_id: Annotated[str, Field(pattern=r"^job_[0-9a-f]{1,40}$")]
    token: Annotated[int, Field(ge=1, lt=2**63)]


class Heartbeat(RunnerReport):
    """A runner's sign of life, for itself and for its leases."""

    leases: Annotated[list[HeldLease], Field(max_length=128)] = Field(default=[])


class LeaseStates(View):
    """Leases that remain valid; work under the others must stop and is not accepted."""

    live: list[HeldLease]
    lost: list[HeldLease]


class NamedFile(Document):
    """An uploaded file to be kept with the job."""

    sha256: Sha256
    name: Annotated[str, Field(pattern=f"^{EVIDENCE_NAME}$", max_length=80, examples=["log-0.txt"])]
    """KIND-NUMBER.ENDING, with the rollout's number."""


Files = Annotated[list[NamedFile], Field(max_length=MAX_LEASE_FILES - 1)]
Seconds = Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)]


class Annotation(Document):
    """Score of one of our engines for a machine that the game tried."""

    success: bool
    indicator: Finite
    flags: Annotated[list[Annotated[str, Field(max_length=60)]], Field(max_length=32)]
    simulation: Annotated[str, Field(max_length=80)]
    engine_version: Annotated[str, Field(max_length=80)]


EngineName = Annotated[str, AfterValidator(lambda name: _one_of(name, ALL_ENGINES))]


class TrialOutcome(Document):
    """Outcome of a trial; the service computes its score."""

    trajectory: Sha256 | None
    """SHA-256 of the uploaded Parquet file; null when the simulator refused the machine, or its
    program failed: `versions.refused` has the reason."""
    versions: Facts = Field(description="Everything about the simulator that can change it")
    wall_s: Seconds
    """Duration of the trial."""
    files: Files = Field(default=[])
    annotations: Annotated[dict[EngineName, Annotation], Field(max_length=8)] | None = None


class TrialFault(Document):
    """A failure of the runner or its simulator: the trial is not scored."""

    reason: FaultReason
    detail: Annotated[str, Field(min_length=1, max_length=4000)]
    """For people."""
    permanent: bool = False
    """Whether no attempt of this key's runners can fix it: they do not get the job again, and it
    ends when a runner of another key reports the same."""
    files: Files = Field(default=[])


class LeaseEnd(View):
    """The end of a lease."""

    status: Literal["done", "already_done"]
    """already_done: an equal request came before, and its answer was lost."""


def _one_of(name: str, names: tuple[str, ...]) -> str:
    if name not in names:
        raise ValueError(f"unknown engine {name!r}; choose from {', '.join(names)}")
    return name
