"""What BuildArena keeps: tables, repositories and artifacts.

Postgres is the truth about jobs; the artifact store keeps the large results by content hash.
Rows leave this package as frozen dataclasses, never as database objects.
"""

from buildarena_store.accounts.budgets import Budget, BudgetLimits, Budgets, Need, Shortage
from buildarena_store.accounts.keys import ApiKey, ApiKeys, KeyCheck
from buildarena_store.artifacts import ArtifactInfo, ArtifactStore
from buildarena_store.boards import (
    BoardCells,
    BoardChange,
    Boards,
    CellId,
    CellRecord,
    Mark,
    Round,
    TrialFilter,
)
from buildarena_store.database import Database
from buildarena_store.errors import (
    ArtifactDamagedError,
    ArtifactMissingError,
    ArtifactStoreError,
    EndedKeyError,
    NameTakenError,
    NotOwnedError,
    SchemaVersionError,
    StaleLeaseError,
    StoreError,
    TooManyFilesError,
    TooManyLeasesError,
    TransitionError,
    UnknownIdError,
    UploadError,
)
from buildarena_store.events import Event, Events
from buildarena_store.jobs.external_calls import ExternalCall, ExternalCalls
from buildarena_store.jobs.job import Job, JobKey, NewJob
from buildarena_store.jobs.jobs import Jobs
from buildarena_store.jobs.journal import Journal, JournalEntry, Usage
from buildarena_store.jobs.leases import Lease, Leases
from buildarena_store.jobs.results import JobScore, Results
from buildarena_store.jobs.rollouts import RolloutRecord, RolloutRequest, Rollouts
from buildarena_store.jobs.runner_leases import RunnerLeases
from buildarena_store.jobs.turns import TurnRecord, TurnResult, Turns
from buildarena_store.jobs.verifications import Verification, Verifications
from buildarena_store.metrics import STAGE_SECONDS, Metrics, MetricValues
from buildarena_store.states import (
    JobState,
    Outcome,
    Stage,
    SweepState,
)
from buildarena_store.store import Store, open_store
from buildarena_store.sweeps.forecasts import SweepForecast
from buildarena_store.sweeps.sweeps import NewSweep, Sweep, SweepProgress, Sweeps
from buildarena_store.tasks import StoredTask, Tasks
from buildarena_store.text import clean
from buildarena_store.uploads import UploadedFile, Uploads
from buildarena_store.workers import Announcement, WorkerCounts, WorkerInfo, Workers

__all__ = [
    "STAGE_SECONDS",
    "Announcement",
    "ApiKey",
    "ApiKeys",
    "ArtifactDamagedError",
    "ArtifactInfo",
    "ArtifactMissingError",
    "ArtifactStore",
    "ArtifactStoreError",
    "BoardCells",
    "BoardChange",
    "Boards",
    "Budget",
    "BudgetLimits",
    "Budgets",
    "CellId",
    "CellRecord",
    "Database",
    "EndedKeyError",
    "Event",
    "Events",
    "ExternalCall",
    "ExternalCalls",
    "Job",
    "JobKey",
    "JobScore",
    "JobState",
    "Jobs",
    "Journal",
    "JournalEntry",
    "KeyCheck",
    "Lease",
    "Leases",
    "Mark",
    "MetricValues",
    "Metrics",
    "NameTakenError",
    "Need",
    "NewJob",
    "NewSweep",
    "NotOwnedError",
    "Outcome",
    "Results",
    "RolloutRecord",
    "RolloutRequest",
    "Rollouts",
    "Round",
    "RunnerLeases",
    "SchemaVersionError",
    "Shortage",
    "Stage",
    "StaleLeaseError",
    "Store",
    "StoreError",
    "StoredTask",
    "Sweep",
    "SweepForecast",
    "SweepProgress",
    "SweepState",
    "Sweeps",
    "Tasks",
    "TooManyFilesError",
    "TooManyLeasesError",
    "TransitionError",
    "TrialFilter",
    "TurnRecord",
    "TurnResult",
    "Turns",
    "UnknownIdError",
    "UploadError",
    "UploadedFile",
    "Uploads",
    "Usage",
    "Verification",
    "Verifications",
    "WorkerCounts",
    "WorkerInfo",
    "Workers",
    "clean",
    "open_store",
]
