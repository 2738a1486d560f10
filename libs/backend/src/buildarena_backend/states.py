"""States of jobs and sweeps, which may follow which, and the queues that jobs wait in.

The values are what the tables, the event log and the API hold.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import StrEnum
from typing import Final

from buildarena_benchmark import outcomes

Outcome = outcomes.Outcome
"""Result of a job."""
CONSTRUCT_QUEUE: Final = "construct"
VERIFY_QUEUE: Final = "verify"
BUILTIN_PROVIDER: Final = "builtin"
"""Provider of the built-in models: they cost nothing, so no budget counts what they do."""
EXTERNAL_PROVIDER: Final = "external"
"""Provider in the configuration of external agents: their requests and tokens are unknown."""
FILE_PROVIDER: Final = "file"
"""Provider in the configuration of machines from files: they were not built here."""
EXTERNAL_QUEUE: Final = "external"
"""Queue of external agents' jobs during construction: no worker serves it."""

TURN: Final = "turn"
"""Kind of the events about replies that a session took: in a job's stream, not in a sweep's."""


def simulate_queue(simulator: str) -> str:
    """Return the queue of a simulator."""
    return f"simulate.{simulator}"


class JobState(StrEnum):
    """State of a job.

    Attributes:
        QUEUED: Waits for a worker.
        RUNNING: A worker, or an external agent, works on it.
        ON_HOLD: Its sweep is paused or out of budget.
        DONE: Ended; its outcome says how.
    """

    QUEUED = "queued"
    RUNNING = "running"
    ON_HOLD = "on_hold"
    DONE = "done"


class Stage(StrEnum):
    """Next step of a job: its session continues, or its machine is simulated."""

    CONSTRUCT = "construct"
    SIMULATE = "simulate"


class SweepState(StrEnum):
    """State of a sweep as its owner or budget set it. A cancelled sweep stays cancelled.

    Attributes:
        DONE: Active, and every job has ended; shown, never stored.
    """

    ACTIVE = "active"
    PAUSED = "paused"
    BUDGET_EXHAUSTED = "budget_exhausted"
    CANCELLED = "cancelled"
    DONE = "done"


class AttemptResult(StrEnum):
    """Result of a worker's attempt at a job's stage.

    Attributes:
        DONE: The stage was done.
        FAULT: Infrastructure failed.
        PERMANENT_FAULT: A runner reported that it can never do it.
        HANDED_BACK: The worker shut down.
        LOST: The worker sent no heartbeat.
        BUDGET_EXHAUSTED: No budget was left for the next model request.
        CANCELLED: The job was cancelled meanwhile.
    """

    DONE = "done"
    FAULT = "fault"
    PERMANENT_FAULT = "permanent_fault"
    HANDED_BACK = "handed_back"
    LOST = "lost"
    BUDGET_EXHAUSTED = "budget_exhausted"
    CANCELLED = "cancelled"


class VerificationState(StrEnum):
    """State of a verification."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"


class Verdict(StrEnum):
    """Result of a verification.

    Attributes:
        VERIFIED: Every figure is equal.
        REFUTED: A figure differs, with the same versions of everything.
        INCONCLUSIVE: Undecidable here: other versions, or something is missing or damaged.
    """

    VERIFIED = "verified"
    REFUTED = "refuted"
    INCONCLUSIVE = "inconclusive"


class Audit(StrEnum):
    """State of a score that had to be verified, or was refuted; others have none.

    Attributes:
        REQUIRED: Counts once it is verified.
        VERIFIED: Counts.
        REFUTED: Counts nowhere.
    """

    REQUIRED = "required"
    VERIFIED = "verified"
    REFUTED = "refuted"


JOB_TRANSITIONS: Final[Mapping[JobState, frozenset[JobState]]] = {
    JobState.QUEUED: frozenset({JobState.RUNNING, JobState.ON_HOLD, JobState.DONE}),
    # From running to on hold when its payer cancels, and its other claimants let it wait.
    JobState.RUNNING: frozenset({JobState.QUEUED, JobState.ON_HOLD, JobState.DONE}),
    JobState.ON_HOLD: frozenset({JobState.QUEUED, JobState.DONE}),
    # An errored job is retried; a cancelled one is wanted again.
    JobState.DONE: frozenset({JobState.QUEUED}),
}
"""Permitted transitions of a job's state."""
SWEEP_TRANSITIONS: Final[Mapping[SweepState, frozenset[SweepState]]] = {
    SweepState.ACTIVE: frozenset(
        {SweepState.PAUSED, SweepState.BUDGET_EXHAUSTED, SweepState.CANCELLED}
    ),
    SweepState.PAUSED: frozenset({SweepState.ACTIVE, SweepState.CANCELLED}),
    SweepState.BUDGET_EXHAUSTED: frozenset({SweepState.ACTIVE, SweepState.CANCELLED}),
    SweepState.CANCELLED: frozenset(),
    SweepState.DONE: frozenset(),
}
"""Permitted transitions of a sweep's state."""


def sweep_states_before(state: SweepState) -> tuple[SweepState, ...]:
    """Return the states that a sweep may leave for this one."""
    return tuple(before for before, after in SWEEP_TRANSITIONS.items() if state in after)


def require_legal(to: JobState, allowed_from: Collection[JobState]) -> None:
    """Check that a transition is one that jobs have; it is a mistake in the code when not.

    Raises:
        ValueError: It is not.
    """
    illegal = [state for state in allowed_from if to not in JOB_TRANSITIONS[state]]
    if illegal:
        raise ValueError(f"no job goes from {', '.join(illegal)} to {to}")
