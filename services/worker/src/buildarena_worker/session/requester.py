"""Requests to a model under a lease; the reply is written to the journal before it is used."""

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
MAX_STORED_MESSAGE = 40_000
"""Characters of a message to a role that the journal stores."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Requester:
    """Source of replies for one job.

    Attributes:
        active: The lease under which the session runs.
        guard: Reserves the maximum cost of a request before it is sent.
        gate: Gate whose place is released while the session waits for a reply.
        owner: API key that pays for the session; empty for the operator's.
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
        """Return the model's reply as stored in the journal.

        Args:
            failures: Number of unreadable replies before, which determines the wait.

        Raises:
            SessionEnded: The budget is used up, or the lease ended.
        """
        request_hash = request.hash  # reads the whole conversation, so it needs a place
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
                prompt_messages=clean(_new_messages(request)),
            )
            try:
                self.journal.append(self.active.lease, entry)
            except StaleLeaseError as stale:
                # The job was cancelled or lost meanwhile, but its budgets did pay for the reply.
                self.guard.charge_lost(entry.usage)
                raise SessionEnded(Superseded()) from stale
        return entry

    def _wait(self, failures: int, spending: Spending) -> float:
        """Wait after unreadable replies, and return the seconds waited."""
        if not failures:
            return 0.0
        wait_s: float = min(FIRST_WAIT_S * 2 ** (failures - 1), spending.seconds_left)
        self.active.wait(wait_s)
        return wait_s

    def _completion(self, request: Request, place: PlaceOfRequest, within_s: float) -> Completion:
        options = RequestOptions(within_s=within_s, active=self.active, owner=self.owner)
        try:
            with request_span(request, place) as record:
                completion = self.client.complete(request, options)
                record(completion)
        except CancelledError:
            if self.active.lost and options.sent.is_set():
                self.guard.charge_lost(self.guard.sent(request))
            require_open(self.active)
            raise
        if completion.finish == OUT_OF_TIME and options.sent.is_set():
            return replace(completion, usage=self.guard.sent(request))
        return completion


def _new_messages(request: Request) -> dict[str, Any] | None:
    """Return a request's new messages in the journal's form; None without any."""
    texts: dict[str, Any] = {"user": []}
    for message in request.new_messages:
        text = message.text[:MAX_STORED_MESSAGE]
        if message.role == "system":
            texts["system"] = text
        else:
            texts["user"].append(text)
    return texts if request.new_messages else None
