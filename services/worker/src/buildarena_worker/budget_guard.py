"""The budget guard: no model request is sent before its means are reserved."""

from __future__ import annotations

import time
from collections.abc import Callable
from decimal import Decimal

from buildarena_pipeline.runtime.active_lease import ActiveLease
from buildarena_store import Budgets, Need, Shortage
from buildarena_worker.errors import LeaseLostError, WorkerError
from buildarena_worker.session.messages import Request

WAIT_S = 0.2
CHARACTERS_PER_TOKEN = 3
"""English has about four; fewer reserves a little too much rather than too little."""
OUTPUT_TOKENS = 4096
"""Reserved for a reply whose length is not limited: more than nearly all replies have."""

Price = Callable[[int, int], Decimal]
"""US dollars for input and output tokens."""


class BudgetUsedUpError(WorkerError):
    """A budget can't pay for the job's next request.

    Attributes:
        shortage: Which budget, and what is lacking.
    """

    def __init__(self, shortage: Shortage) -> None:
        super().__init__(shortage.detail)
        self.shortage = shortage


class BudgetGuard:
    """Reserves the means of one job's requests.

    Args:
        budgets: Where budgets are.
        active: The lease on the job. A budget that its sweep is given meanwhile takes effect with
            the next heartbeat.
        price: What tokens of the job's model cost.
    """

    def __init__(self, budgets: Budgets, active: ActiveLease, price: Price) -> None:
        self._budgets = budgets
        self._active = active
        self._price = price

    def __call__(self, request: Request) -> None:
        """Reserves what a request may cost; waits while open requests may give back enough.

        Raises:
            BudgetUsedUpError: No budget is left for it.
            LeaseLostError: The lease ended while it waited.
        """
        if not self._active.budgeted:
            return
        need = self._need(request)
        while (shortage := self._budgets.reserve(self._active.lease, need)) is not None:
            if not shortage.temporary:
                raise BudgetUsedUpError(shortage)
            if self._active.lost:
                raise LeaseLostError("the lease ended while the job waited for its budget")
            time.sleep(WAIT_S)

    def _need(self, request: Request) -> Need:
        given = request.model_config["decoding"].get("max_tokens")
        output = OUTPUT_TOKENS if given is None else int(given)
        characters = sum(len(message.text) for message in request.messages)
        characters += sum(len(f"{tool.description}{tool.parameters}") for tool in request.tools)
        sent = characters // CHARACTERS_PER_TOKEN
        return Need(cost_usd=self._price(sent, output), tokens=sent + output)
