"""The outside world of a session: model replies and simulations.

A session is a deterministic function of its task, seed, settings, completions and simulations.
Completions and simulations are stored, so an interrupted session is resumed by repeating it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from buildarena_backend.errors import PermanentError, TransientError
from buildarena_backend.journal.journal import JournalEntry
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import Trajectory
from buildarena_worker.session.messages import Completion, Request
from buildarena_worker.session.requester import Requester, Spending
from buildarena_worker.session.results import SessionEnded, Suspended

GARBAGE_IN_A_ROW = 6
"""Consecutive unreadable answers after which the provider counts as failed."""
OUTAGE_DELAY_S = 30.0


Setup = tuple[Machine, Sequence[KeyPress] | None]
"""A machine, and the key presses of its trial; None for its own, or for its program."""


class SessionHost(Protocol):
    """Source of a session's completions and simulations."""

    def ask(self, request: Request) -> Completion:
        """Return the model's reply to a request, with what it cost.

        Raises:
            SessionEnded: There is none, and the session can't continue.
        """

    def simulate(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool
    ) -> RolloutRecord:
        """Return the result of simulating the machine.

        Raises:
            SessionEnded: It is not available yet; the session must be repeated when it is.
        """

    def trajectory(self, record: RolloutRecord) -> Trajectory | None:
        """Return the trajectory of a rollout; None when its machine could not be simulated."""


@dataclass(slots=True, kw_only=True, eq=False)
class JournalHost:
    """Source of the stored completions, then of a model's.

    Attributes:
        entries: Entries of the job's journal.
        rollouts: The job's rollouts; unfinished ones and those in varied worlds are ignored.
        limits: The job's limits.
        load_trajectory: Reads a stored trajectory by its hash.
        requester: Source of replies after the end of the journal; None for replays.
        simulated: Copies of the machines whose rollouts were returned, with their key presses. An
            analyst's later lookups would be added to the log of the originals.
        spending: Use of the given completions so far.
    """

    entries: Sequence[JournalEntry]
    rollouts: Sequence[RolloutRecord]
    limits: Mapping[str, Any]
    load_trajectory: Callable[[str], Trajectory]
    requester: Requester | None = None
    simulated: list[Setup] = field(default_factory=list)
    spending: Spending = field(init=False)
    _sequence: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        """Begin without having spent anything."""
        self.spending = Spending(self.limits)

    def ask(self, request: Request) -> Completion:
        """Return the stored completion of a request if there is one, otherwise the model's.

        Raises:
            SessionEnded: A limit or the budget is used up, or the worker stops.
            StaleLeaseError: The lease is over.
            PermanentError: The stored completion belongs to another request, or there is neither
                one nor a model.
        """
        stored = self._stored(request)
        if stored is not None:
            return stored
        for failures in range(GARBAGE_IN_A_ROW):
            self.spending.require_room()
            if self.requester is None:
                raise _mismatch(f"the journal ends at entry {self._sequence}")
            entry = self.requester.request(request, self._sequence, self.spending, failures)
            self._count(entry)
            if entry.answers:
                return Completion.from_entry(entry)
        self.spending.require_room()
        raise TransientError(
            f"{GARBAGE_IN_A_ROW} answers in a row can't be read, the last: {entry.reply['text']}",
            reason="provider_outage",
            delay_s=OUTAGE_DELAY_S,
        )

    def _stored(self, request: Request) -> Completion | None:
        """Return the stored completion of a request, if there is one.

        Entries without a usable reply are counted and skipped: the request was repeated.
        """
        while self._sequence < len(self.entries):
            self.spending.require_room()
            entry = self.entries[self._sequence]
            if entry.request_hash != request.hash:
                raise _mismatch(
                    f"entry {self._sequence} ({entry.stage}, {entry.role}) belongs to another "
                    "request: the session's code or prompts have changed since"
                )
            self._count(entry)
            if entry.answers:
                return Completion.from_entry(entry)
        return None

    def _count(self, entry: JournalEntry) -> None:
        self._sequence += 1
        self.spending.add(entry)

    def simulate(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool
    ) -> RolloutRecord:
        """Return the stored rollout of the machine.

        Raises:
            SessionEnded: There is none yet: the session suspends.
        """
        number = len(self.simulated)
        finished = [r for r in self.rollouts if r.finished_at is not None and not r.is_varied]
        if number >= len(finished):
            raise SessionEnded(
                Suspended(machine=machine, controls=controls, final=final, number=number)
            )
        self.simulated.append((machine.copy(), controls))
        return finished[number]

    def trajectory(self, record: RolloutRecord) -> Trajectory | None:
        """Return the trajectory of a rollout; None when its machine could not be simulated."""
        digest = record.trajectory_hash
        return None if digest is None else self.load_trajectory(digest)


def _mismatch(detail: str) -> PermanentError:
    return PermanentError(detail, reason="journal_mismatch")
