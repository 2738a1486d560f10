"""Patience: how long a session waits for an answer."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field

from buildarena_backend.process.active_lease import ActiveLease


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestOptions:
    """What ends the wait for an answer; nothing by default.

    Attributes:
        within_s: The seconds that the job's limit leaves for it.
        active: The lease that it is wanted under.
        owner: Whose request it is; empty for the operator's.
        sent: Set as soon as the request may cost something.
    """

    within_s: float = math.inf
    active: ActiveLease | None = None
    owner: str = ""
    sent: threading.Event = field(default_factory=threading.Event)


UNBOUNDED = RequestOptions()
