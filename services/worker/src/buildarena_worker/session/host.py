"""What a session asks of the outside world: model replies and simulations.

A session is a deterministic function of its task, seed, settings and the completions and
simulations that came through here. Both are stored, so a session that died is resumed by running
it again: it gets what is stored first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import replace
from typing import Any, Protocol

from buildarena_backend.database.text import clean
from buildarena_backend.errors import StaleLeaseError, TransientError
from buildarena_backend.journal.journal import OUT_OF_TIME, Journal, JournalEntry, Usage
from buildarena_backend.journal.rollouts import RolloutRecord
from buildarena_backend.process.active_lease import ActiveLease
from buildarena_geometry import KeyPress, Machine
from buildarena_simulation import Trajectory
from buildarena_worker.session.budget_guard import BudgetGuard, require_open
from buildarena_worker.session.concurrency_gate import ConcurrencyGate
from buildarena_worker.session.messages import Completion, ModelClient, Request
from buildarena_worker.session.request_options import RequestOptions
from buildarena_worker.session.request_spans import PlaceOfRequest, request_span
from buildarena_worker.session.results import Diverged, SessionEnded, Superseded, Suspended
from buildarena_worker.session.spending import Spending

GARBAGE_IN_A_ROW = 6
"""After so many answers in a row that can't be read, the provider is taken to be out of order."""
FIRST_WAIT_S = 0.25
OUTAGE_DELAY_S = 30.0
LONGEST_TOLD = 40_000
"""Characters of a message to a role that a journal keeps."""


class SessionHost(Protocol):
    """Where a session's completions and simulations come from."""

    def ask(self, request: Request, *, phase: str, role: str) -> Completion:
        """The model's reply to a request, with what it cost.

        Raises:
            SessionEnded: There is none, and the session can't go on.
        """

    def simulate(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool
    ) -> RolloutRecord:
        """The result of simulating the machine.

        Raises:
            SessionEnded: It is not there yet; the session is to be run again when it is.
        """

    def trajectory(self, record: RolloutRecord) -> Trajectory | None:
        """The trajectory of a rollout; None when its machine could not be simulated."""


class ReplayHost:
    """Gives what is stored, and nothing else.

    Args:
        entries: The job's journal.
        rollouts: Its rollouts; those that are not finished, or in varied worlds, do not count.
        limits: Its limits.
        load_trajectory: Reads a stored trajectory by its hash.

    Attributes:
        simulated: Copies of the machines whose rollouts were given, with their key presses. What an
            analyst looks up in a machine later is added to its log, so a copy is kept.
    """

    def __init__(
        self,
        *,
        entries: Sequence[JournalEntry],
        rollouts: Sequence[RolloutRecord],
        limits: Mapping[str, Any],
        load_trajectory: Callable[[str], Trajectory],
    ) -> None:
        self._entries = entries
        self._rollouts = [r for r in rollouts if r.finished_at is not None and r.seed is None]
        self._load_trajectory = load_trajectory
        self._spending = Spending(limits)
        self._sequence = 0
        self.simulated: list[tuple[Machine, Sequence[KeyPress] | None]] = []

    @property
    def sequence(self) -> int:
        """Place of the next completion in the journal."""
        return self._sequence

    @property
    def usage(self) -> Usage:
        """What the given completions cost together."""
        return self._spending.usage

    @property
    def spending(self) -> Spending:
        """What was used, and the limits on it."""
        return self._spending

    def ask(self, request: Request, *, phase: str, role: str) -> Completion:
        """The stored completion of a request.

        Raises:
            SessionEnded: A limit is reached, the journal has come to its end, or its completion
                belongs to another request.
        """
        del phase, role
        completion = self.stored(request)
        if completion is None:
            self.require_room()
            raise SessionEnded(Diverged(detail=f"the journal ends at entry {self._sequence}"))
        return completion

    def stored(self, request: Request) -> Completion | None:
        """The stored completion of a request, if there is one.

        Entries without a usable reply are counted and passed over: the request was repeated.

        Raises:
            SessionEnded: A limit is reached, or the completion belongs to another request.
        """
        while self._sequence < len(self._entries):
            self.require_room()
            entry = self._entries[self._sequence]
            if entry.request_hash != request.hash:
                raise SessionEnded(
                    Diverged(
                        detail=f"entry {self._sequence} ({entry.stage}, {entry.role}) was asked "
                        "otherwise: the session's code or prompts have changed since"
                    )
                )
            self.count(entry)
            if entry.answers:
                return Completion.from_entry(entry)
        return None

    def require_room(self) -> None:
        """Checks that the job's limits allow one more request.

        Raises:
            SessionEnded: A limit is reached.
        """
        self._spending.require_room()

    def count(self, entry: JournalEntry) -> None:
        """Counts an entry that was read here, or written by a host that goes on from here."""
        self._sequence += 1
        self._spending.add(entry)

    def simulate(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool
    ) -> RolloutRecord:
        """The stored rollout of the machine.

        Raises:
            SessionEnded: There is none yet.
        """
        number = len(self.simulated)
        if number >= len(self._rollouts):
            raise SessionEnded(
                Suspended(machine=machine, controls=controls, final=final, number=number)
            )
        self.simulated.append((machine.copy(), controls))
        return self._rollouts[number]

    def trajectory(self, record: RolloutRecord) -> Trajectory | None:
        """The trajectory of a rollout; None when its machine could not be simulated."""
        if record.trajectory_hash is None:
            return None
        return self._load_trajectory(record.trajectory_hash)


class LiveHost:
    """Gives what is stored first, then asks the model, and stores its completions.

    Args:
        replay: What is stored so far.
        client: Completes new requests.
        journal: Stores a completion before it is used.
        active: The lease under which the session runs.
        guard: Reserves what a request may cost before it is sent.
        gate: Where the session gives up its place while it waits for a reply.
        first_wait_s: Seconds to wait after a reply that can't be read; doubles with each.
        owner: Whose session it is; empty for the operator's.
    """

    def __init__(
        self,
        *,
        replay: ReplayHost,
        client: ModelClient,
        journal: Journal,
        active: ActiveLease,
        guard: BudgetGuard,
        gate: ConcurrencyGate,
        first_wait_s: float | None = None,
        owner: str = "",
    ) -> None:
        self._replay = replay
        self._client = client
        self._journal = journal
        self._active = active
        self._budget = guard
        self._gate = gate
        self._owner = owner
        self._first_wait_s = FIRST_WAIT_S if first_wait_s is None else first_wait_s

    def ask(self, request: Request, *, phase: str, role: str) -> Completion:
        """The stored completion of a request if there is one, otherwise the model's.

        Raises:
            SessionEnded: The limits or the budget allow no more, the lease ended, or the stored
                completion belongs to another request.
        """
        stored = self._replay.stored(request)
        if stored is not None:
            return stored
        for failures in range(GARBAGE_IN_A_ROW):
            self._replay.require_room()
            entry = self._requested(request, failures, phase=phase, role=role)
            if entry.answers:
                return Completion.from_entry(entry)
        self._replay.require_room()
        raise TransientError(
            f"{GARBAGE_IN_A_ROW} answers in a row can't be read, the last: {entry.reply['text']}",
            reason="provider_outage",
            delay_s=OUTAGE_DELAY_S,
        )

    def _requested(self, request: Request, failures: int, *, phase: str, role: str) -> JournalEntry:
        """The model's reply as the journal has it; it waits first after unreadable ones."""
        sequence = self._replay.sequence
        request_hash = request.hash  # a walk through the whole conversation, which wants a place
        with self._gate.released():
            waited_s = self._wait(failures)
            require_open(self._active)
            self._budget.reserve(request)
            completion = self._completion(
                request, waited_s, PlaceOfRequest(phase=phase, role=role, sequence=sequence)
            )
            latency_s = waited_s + completion.latency_s
            if completion.finish == OUT_OF_TIME:
                latency_s = self._replay.spending.to_the_end(latency_s)
            entry = JournalEntry(
                sequence=sequence,
                stage=phase,
                role=role,
                request_hash=request_hash,
                reply=clean(completion.to_json()),
                usage=completion.usage,
                latency_s=latency_s,
                tries=completion.attempts,
                provider_request_id=clean(completion.provider_request_id),
                told=clean(_told(request)),
            )
            self._store(entry)
        self._replay.count(entry)
        return entry

    def _wait(self, failures: int) -> float:
        """Waits after so many replies that can't be read; returns how long."""
        if not failures:
            return 0.0
        wait_s: float = min(
            self._first_wait_s * 2 ** (failures - 1), self._replay.spending.seconds_left
        )
        self._active.wait(wait_s)
        return wait_s

    def _completion(self, request: Request, waited_s: float, place: PlaceOfRequest) -> Completion:
        left_s = self._replay.spending.seconds_left - waited_s
        options = RequestOptions(within_s=left_s, active=self._active, owner=self._owner)
        try:
            with request_span(request, place) as answered:
                completion = self._client.complete(request, options)
                answered(completion)
        except CancelledError:
            if self._active.lost and options.sent.is_set():
                self._budget.charge_lost(self._budget.sent(request))
            require_open(self._active)
            raise
        if completion.finish == OUT_OF_TIME and options.sent.is_set():
            return replace(completion, usage=self._budget.sent(request))
        return completion

    def _store(self, entry: JournalEntry) -> None:
        try:
            self._journal.append(self._active.lease, entry)
        except StaleLeaseError as stale:
            # The job was cancelled or lost meanwhile, but its budgets did pay for the reply.
            self._budget.charge_lost(entry.usage)
            raise SessionEnded(Superseded()) from stale

    def simulate(
        self, machine: Machine, controls: Sequence[KeyPress] | None, *, final: bool
    ) -> RolloutRecord:
        """The stored rollout of the machine.

        Raises:
            SessionEnded: There is none yet: the session suspends.
        """
        return self._replay.simulate(machine, controls, final=final)

    def trajectory(self, record: RolloutRecord) -> Trajectory | None:
        """The trajectory of a rollout; None when its machine could not be simulated."""
        return self._replay.trajectory(record)


def _told(request: Request) -> dict[str, Any] | None:
    """What the session says with a request, as journals keep it; None when it says nothing."""
    told: dict[str, Any] = {"user": []}
    for message in request.told:
        text = message.text[:LONGEST_TOLD]
        if message.role == "system":
            told["system"] = text
        else:
            told["user"].append(text)
    return told if request.told else None
