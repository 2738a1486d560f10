"""Requests to a model under a lease.

The cost of each is reserved before it is sent, and its reply journalled before it is used.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import Any, Final

from opentelemetry.trace import SpanKind

from buildarena_backend.accounts.budgets import Budgets, RequestCost
from buildarena_backend.database.text import clean
from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.journal.journal import OUT_OF_TIME, Journal, JournalEntry, Usage
from buildarena_backend.process.active_lease import ActiveLease
from buildarena_backend.telemetry.tracing import Attribute, mark_failed, span
from buildarena_worker.session.concurrency_gate import ConcurrencyGate
from buildarena_worker.session.messages import Completion, ModelClient, Request, RequestOptions
from buildarena_worker.session.results import BudgetExhausted, Drained, Failed, SessionEnded

FIRST_WAIT_S = 0.25
"""Wait after a reply that can't be read; doubles with each."""
PROVIDERS: Final[Mapping[str, str]] = {
    "google": "gcp.gemini",
    "mistral": "mistral_ai",
    "xai": "x_ai",
}
"""The conventions' names of providers, where they differ from the registry's."""
USUAL_ENDS: Final = frozenset({"stop", "length", "tool_call"})
"""Finish reasons of usable replies; others are failures of the request."""
BUDGET_WAIT_S = 0.2
CHARACTERS_PER_TOKEN = 3
"""English has about four; a lower number reserves a little too much rather than too little."""
OUTPUT_TOKENS = 4096
"""Reserved for a reply whose length is not limited: more than nearly all replies have."""

Price = Callable[[int, int], Decimal]
"""US dollars for input and output tokens."""


@dataclass(slots=True)
class Spending:
    """Use of a session so far, replayed answers included.

    Attributes:
        limits: The job's limits by name.
        usage: Requests, tokens and money.
        seconds: Time that its model took.
    """

    limits: Mapping[str, Any]
    usage: Usage = field(default_factory=Usage)
    seconds: float = 0.0

    def add(self, entry: JournalEntry) -> None:
        """Count an answer."""
        self.usage += entry.usage
        self.seconds += entry.latency_s

    @property
    def remaining_s(self) -> float:
        """Seconds until the job's limit; infinite without a limit."""
        return self._most_seconds - self.seconds

    def to_the_end(self, latency_s: float) -> float:
        """Return the latency of an answer that did not arrive in time, which reaches the limit."""
        while self.seconds + latency_s < self._most_seconds < math.inf:
            latency_s = max(latency_s, self.remaining_s) + math.ulp(self.seconds + latency_s)
        return latency_s

    @property
    def _most_seconds(self) -> float:
        limit = self.limits.get("max_duration_s")
        return math.inf if limit is None else float(limit)

    def require_room(self) -> None:
        """Check that the session may send another request.

        Raises:
            SessionEnded: A limit is reached.
        """
        spent: dict[str, float | Decimal] = {
            "max_requests": self.usage.requests,
            "max_tokens": self.usage.input_tokens + self.usage.output_tokens,
            "max_cost_usd": self.usage.cost_usd,
            "max_duration_s": self.seconds,
        }
        for name, value in spent.items():
            limit = self.limits.get(name)
            if limit is not None and float(value) >= float(limit):
                detail = f"{name} is {limit}, the session used {value}"
                raise SessionEnded(Failed(reason=name, detail=detail))


@dataclass(frozen=True, slots=True, kw_only=True)
class Requester:
    """Source of replies for one job.

    Attributes:
        active: The lease under which the session runs; a budget added to its sweep applies from the
            next heartbeat on.
        budgets: Where the maximum cost of a request is reserved before it is sent.
        price: Function that returns the cost of a number of tokens.
        gate: Gate whose place is released while the session waits for a reply.
        owner: API key that pays for the session; empty for the operator's.
    """

    client: ModelClient
    journal: Journal
    active: ActiveLease
    budgets: Budgets
    price: Price
    gate: ConcurrencyGate
    owner: str = ""

    def request(
        self, request: Request, sequence: int, spending: Spending, failures: int
    ) -> JournalEntry:
        """Return the model's reply as stored in the journal.

        Args:
            sequence: Index in the journal, from 0.
            failures: Number of unreadable replies before, which determines the wait.

        Raises:
            SessionEnded: The budget is used up, or the worker stops.
            StaleLeaseError: The lease is over.
        """
        request_hash = request.hash  # reads the whole conversation, so it needs a place
        with self.gate.released():
            waited_s = self._wait(failures, spending)
            self._require_open()
            self._reserve(request)
            completion = self._completion(request, sequence, spending.remaining_s - waited_s)
            latency_s = waited_s + completion.latency_s
            if completion.finish == OUT_OF_TIME:
                latency_s = spending.to_the_end(latency_s)
            entry = JournalEntry(
                sequence=sequence,
                stage=request.phase,
                role=request.role,
                request_hash=request_hash,
                reply=clean(completion.to_json()),
                usage=completion.usage,
                latency_s=latency_s,
                tries=completion.attempts,
                provider_request_id=clean(completion.provider_request_id),
                system_fingerprint=clean(completion.system_fingerprint),
                failures=clean(list(completion.failures)),
                prompt_messages=clean(request.new_messages),
            )
            try:
                self.journal.append(self.active.lease, entry)
            except StaleLeaseError:
                # The job was cancelled or lost meanwhile, but its budgets did pay for the reply.
                self.budgets.charge_lost(self.active.lease, entry.usage)
                raise
        return entry

    def _require_open(self) -> None:
        """Check that a request may be sent.

        Raises:
            StaleLeaseError: The lease is over.
            SessionEnded: The worker stops.
        """
        if self.active.lost:
            raise StaleLeaseError(self.active.lease.job.id, self.active.lease.token)
        if self.active.draining:
            raise SessionEnded(Drained())

    def _reserve(self, request: Request) -> None:
        """Reserve the maximum cost of a request; wait while open requests may release enough.

        Raises:
            SessionEnded: No budget is left for it, or the worker stops.
            StaleLeaseError: The lease is over.
        """
        if not self.active.budgeted:
            return
        max_tokens = request.model_config["decoding"].get("max_tokens")
        output = OUTPUT_TOKENS if max_tokens is None else int(max_tokens)
        sent = _sent_tokens(request)
        need = RequestCost(cost_usd=self.price(sent, output), tokens=sent + output)
        while (shortage := self.budgets.reserve(self.active.lease, need)) is not None:
            if not shortage.temporary:
                raise SessionEnded(BudgetExhausted(shortage=shortage))
            self._require_open()
            self.active.wait(BUDGET_WAIT_S)

    def _sent(self, request: Request) -> Usage:
        """Return the estimated use of an interrupted request, the tokens sent."""
        tokens = _sent_tokens(request)
        return Usage(requests=1, input_tokens=tokens, cost_usd=self.price(tokens, 0))

    def _wait(self, failures: int, spending: Spending) -> float:
        """Wait after unreadable replies, and return the seconds waited."""
        if not failures:
            return 0.0
        wait_s: float = min(FIRST_WAIT_S * 2 ** (failures - 1), spending.remaining_s)
        self.active.wait(wait_s)
        return wait_s

    def _completion(self, request: Request, sequence: int, within_s: float) -> Completion:
        options = RequestOptions(within_s=within_s, active=self.active, owner=self.owner)
        try:
            with request_span(request, sequence) as record:
                completion = self.client.complete(request, options)
                record(completion)
        except CancelledError:
            if self.active.lost and options.sent.is_set():
                self.budgets.charge_lost(self.active.lease, self._sent(request))
            self._require_open()
            raise
        if completion.finish == OUT_OF_TIME and options.sent.is_set():
            return replace(completion, usage=self._sent(request))
        return completion


def _sent_tokens(request: Request) -> int:
    """Estimate the number of tokens of a request."""
    characters = sum(len(message.text) for message in request.messages)
    characters += sum(len(f"{tool.description}{tool.parameters}") for tool in request.tools)
    return characters // CHARACTERS_PER_TOKEN


@contextmanager
def request_span(request: Request, sequence: int) -> Iterator[Callable[[Completion], None]]:
    """Open a span around a request with all its attempts, by OpenTelemetry's GenAI conventions.

    It contains the model, its use of tokens and the result, but no text of a conversation.

    Source: OpenTelemetry, Semantic conventions for generative AI, client spans.

    Yields:
        Function that records the reply.
    """
    config = request.model_config
    model, provider = str(config["model"]), str(config["provider"])
    attributes: dict[str, Attribute] = {
        "gen_ai.operation.name": "chat",
        "gen_ai.provider.name": PROVIDERS.get(provider, provider),
        "gen_ai.request.model": model,
        "buildarena.model": str(config["name"]),
        "buildarena.phase": request.phase,
        "buildarena.role": request.role,
        "buildarena.sequence": sequence,
    }
    with span(f"chat {model}", attributes, kind=SpanKind.CLIENT) as current:

        def record(completion: Completion) -> None:
            usage = completion.usage
            current.set_attribute("gen_ai.usage.input_tokens", usage.input_tokens)
            current.set_attribute("gen_ai.usage.output_tokens", usage.output_tokens)
            current.set_attribute("gen_ai.usage.cache_read.input_tokens", usage.cached_tokens)
            current.set_attribute("gen_ai.usage.reasoning.output_tokens", usage.reasoning_tokens)
            current.set_attribute("gen_ai.response.finish_reasons", [completion.finish])
            current.set_attribute("buildarena.cost_usd", float(usage.cost_usd))
            current.set_attribute("buildarena.tries", completion.attempts)
            if completion.provider_request_id is not None:
                current.set_attribute("gen_ai.response.id", completion.provider_request_id)
            if completion.finish not in USUAL_ENDS:
                mark_failed(current, completion.finish)

        yield record
