"""Steps that are only done when their effect was seen."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

import structlog

from buildarena_simworker.besiege.errors import StepFailedError

log = structlog.get_logger(__name__)

ATTEMPTS: Final = 3
POLL_S: Final = 0.1


def take_step(
    name: str,
    act: Callable[[], None],
    finding: Callable[[], str | None],
    *,
    timeout_s: float,
    recover: Callable[[], None],
    attempts: int = ATTEMPTS,
) -> None:
    """Acts until the effect is seen.

    Args:
        name: What the step does, for messages.
        act: Does it; must be harmless when done twice.
        finding: None once its effect is seen; otherwise what is seen instead.
        timeout_s: How long the effect may take.
        recover: Clears what may block the step, before the next attempt.
        attempts: How often to act.

    Raises:
        StepFailedError: The effect was never seen.
    """
    seen: str | None = None
    for attempt in range(attempts):
        if attempt:
            log.info("step_again", step=name, finding=seen)
            recover()
        act()
        seen = wait_for(finding, timeout_s=timeout_s)
        if seen is None:
            return
    raise StepFailedError(name, str(seen))


def wait_for(finding: Callable[[], str | None], *, timeout_s: float) -> str | None:
    """Waits until something is seen.

    Args:
        finding: None once it is seen; otherwise what is seen instead.
        timeout_s: How long to wait.

    Returns:
        None when it was seen, otherwise the last finding.
    """
    ends = time.monotonic() + timeout_s
    while True:
        seen = finding()
        if seen is None or time.monotonic() >= ends:
            return seen
        time.sleep(POLL_S)
