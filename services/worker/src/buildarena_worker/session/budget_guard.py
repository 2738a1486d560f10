"""The budget guard: an amount is reserved before each model request."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal

from buildarena_backend.accounts.budgets import Budgets, BudgetShortage, RequestCost
from buildarena_backend.errors import StaleLeaseError
from buildarena_backend.journal.journal import Usage
from buildarena_backend.process.active_lease import ActiveLease
from buildarena_worker.session.messages import Request
from buildarena_worker.session.results import BudgetExhausted, Drained, SessionEnded, Superseded

WAIT_S = 0.2
CHARACTERS_PER_TOKEN = 3
"""English has about four; a lower number reserves a little too much rather than too little."""
OUTPUT_TOKENS = 4096
"""Reserved for a reply whose length is not limited: more than nearly all replies have."""

Price = Callable[[int, int], Decimal]
"""US dollars for input and output tokens."""


def require_open(active: ActiveLease) -> None:
    """Check that a request may be sent under a lease.

    Raises:
        SessionEnded: The lease is over, or its worker stops.
    """
    if active.lost:
        raise SessionEnded(Superseded())
    if active.draining:
        raise SessionEnded(Drained())


@dataclass(frozen=True, slots=True)
class BudgetGuard:
    """Reservation of the cost of one job's requests.

    Attributes:
        active: Lease on the job; a budget added to its sweep applies from the next heartbeat on.
        price: Function that returns the cost of a number of tokens.
    """

    budgets: Budgets
    active: ActiveLease
    price: Price

    def reserve(self, request: Request) -> None:
        """Reserve the maximum cost of a request; wait while open requests may release enough.

        Raises:
            SessionEnded: No budget is left for it, or the lease is over.
        """
        if not self.active.budgeted:
            return
        max_tokens = request.model_config["decoding"].get("max_tokens")
        output = OUTPUT_TOKENS if max_tokens is None else int(max_tokens)
        sent = _sent_tokens(request)
        need = RequestCost(cost_usd=self.price(sent, output), tokens=sent + output)
        while (shortage := self._reserved(need)) is not None:
            if not shortage.temporary:
                raise SessionEnded(BudgetExhausted(shortage=shortage))
            require_open(self.active)
            self.active.wait(WAIT_S)

    def sent(self, request: Request) -> Usage:
        """Return the estimated use of an interrupted request, the tokens sent."""
        tokens = _sent_tokens(request)
        return Usage(requests=1, input_tokens=tokens, cost_usd=self.price(tokens, 0))

    def charge_lost(self, usage: Usage) -> None:
        """Count a reply that was paid for but came after the lease had ended."""
        self.budgets.charge_lost(self.active.lease, usage)

    def _reserved(self, need: RequestCost) -> BudgetShortage | None:
        try:
            return self.budgets.reserve(self.active.lease, need)
        except StaleLeaseError as stale:
            raise SessionEnded(Superseded()) from stale


def _sent_tokens(request: Request) -> int:
    """Estimate the number of tokens of a request."""
    characters = sum(len(message.text) for message in request.messages)
    characters += sum(len(f"{tool.description}{tool.parameters}") for tool in request.tools)
    return characters // CHARACTERS_PER_TOKEN
