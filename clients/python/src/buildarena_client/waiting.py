"""When there is nothing more to wait for."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final

from buildarena_client.errors import TimedOutError

if TYPE_CHECKING:
    from buildarena_client.schemas import SweepView

POLL_S: Final = 0.5
"""Seconds between two looks at what is waited for."""
STOPPED: Final = ("budget_exhausted", "paused")
"""States of sweeps of which nothing more starts."""


def sweep_has_stopped(sweep: SweepView) -> bool:
    """Whether nothing more will happen: every job has ended, or all others are on hold."""
    progress = sweep["progress"]
    moving = [name for name in progress["stages"] if not name.endswith(" on_hold")]
    return not moving and (progress["done"] == progress["total"] or sweep["state"] in STOPPED)


def require_time(what: str, started: float, timeout_s: float | None) -> None:
    """Checks that what is waited for may still take.

    Args:
        what: Its id, for the message.
        started: When the waiting began, by ``time.monotonic``.
        timeout_s: How long it may take; None for forever.

    Raises:
        TimedOutError: It has taken that long.
    """
    if timeout_s is not None and time.monotonic() - started > timeout_s:
        raise TimedOutError(f"{what} has not ended within {timeout_s:g} s")
