"""Asks a model under a lease, and writes its reply to the journal before anybody uses it."""

from __future__ import annotations

from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from typing import Any

from buildarena_backend.database.text import clean
from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.journal.journal import OUT_OF_TIME, Journal, JournalEntry
from buildarena_backend.process.active_lease import ActiveLease
from buildarena_worker.session.budget_guard import BudgetGuard, require_open
from buildarena_worker.session.concurrency_gate import ConcurrencyGate
from buildarena_worker.session.messages import Completion, ModelClient, Request, RequestOptions
from buildarena_worker.session.request_spans import PlaceOfRequest, request_span
from buildarena_worker.session.results import SessionEnded, Superseded
from buildarena_worker.session.spending import Spending

FIRST_WAIT_S = 0.25
"""Wait after a reply that can't be read; doubles with each."""
LONGEST_TOLD = 40_000
"""Characters of a message to a role that a journal keeps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Requester:
    """Asks one job's model.

    Attributes:
        client: Completes requests.
        journal: Stores a completion before it is used.
        active: The lease under which the session runs.
        guard: Reserves what a request may cost before it is sent.
        gate: Where the session gives up its place while it waits for a reply.
        owner: Whose session it is; empty for the operator's.
    """

    client: ModelClient
    journal: Journal
    active: ActiveLease
    guard: BudgetGuard
    gate: ConcurrencyGate
    owner: str = ""

    def request(
        self, request: Request, place: PlaceOfRequest, spending: Spending, failures: int
    ) -> JournalEntry:
        """Return the model's reply as the journal has it.

        Args:
            place: Where in the session.
            spending: What the session used so far.
            failures: Replies before that could not be read: so long it waits first.

        Raises:
            SessionEnded: The budget allows no more, or the lease ended.
        """
        request_hash = request.hash  # a walk through the whole conversation, which wants a place
        with self.gate.released():
            waited_s = self._wait(failures, spending)
            require_open(self.active)
            self.guard.reserve(request)
            completion = self._completion(request, place, spending.seconds_left - waited_s)
            latency_s = waited_s + completion.latency_s
            if completion.finish == OUT_OF_TIME:
                latency_s = spending.to_the_end(latency_s)
            entry = JournalEntry(
                sequence=place.sequence,
                stage=place.phase,
                role=place.role,
                request_hash=request_hash,
                reply=clean(completion.to_json()),
                usage=completion.usage,
                latency_s=latency_s,
                tries=completion.attempts,
                provider_request_id=clean(completion.provider_request_id),
                system_fingerprint=clean(completion.system_fingerprint),
                failures=clean(list(completion.failures)),
                told=clean(_told(request)),
            )
            try:
                self.journal.append(self.active.lease, entry)
            except StaleLeaseError as stale:
                # The job was cancelled or lost meanwhile, but its budgets did pay for the reply.
                self.guard.charge_lost(entry.usage)
                raise SessionEnded(Superseded()) from stale
        return entry

    def _wait(self, failures: int, spending: Spending) -> float:
        """Wait after so many replies that can't be read; return how long."""
        if not failures:
            return 0.0
        wait_s: float = min(FIRST_WAIT_S * 2 ** (failures - 1), spending.seconds_left)
        self.active.wait(wait_s)
        return wait_s

    def _completion(self, request: Request, place: PlaceOfRequest, within_s: float) -> Completion:
        options = RequestOptions(within_s=within_s, active=self.active, owner=self.owner)
        try:
            with request_span(request, place) as answered:
                completion = self.client.complete(request, options)
                answered(completion)
        except CancelledError:
            if self.active.lost and options.sent.is_set():
                self.guard.charge_lost(self.guard.sent(request))
            require_open(self.active)
            raise
        if completion.finish == OUT_OF_TIME and options.sent.is_set():
            return replace(completion, usage=self.guard.sent(request))
        return completion


def _told(request: Request) -> dict[str, Any] | None:
    """Return the session's messages with a request in the journal's form; None without any."""
    told: dict[str, Any] = {"user": []}
    for message in request.told:
        text = message.text[:LONGEST_TOLD]
        if message.role == "system":
            told["system"] = text
        else:
            told["user"].append(text)
    return told if request.told else None
