"""What ends a session before its machine is simulated."""

from __future__ import annotations


class WorkerError(Exception):
    """Base of all errors that the worker room raises itself."""


class ConstructionFailedError(WorkerError):
    """The model did not build a machine that may be simulated: a scored failure.

    Attributes:
        reason: Its class, for example ``objection`` or ``turn_limit``.
    """

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(detail)
        self.reason = reason


class LimitReachedError(WorkerError):
    """The session used up its requests, tokens, money or time.

    Attributes:
        limit: Name of the limit.
    """

    def __init__(self, limit: str, detail: str) -> None:
        super().__init__(detail)
        self.limit = limit


class JournalMismatchError(WorkerError):
    """The session asks something else than its journal says it asked: the code has changed."""


class LeaseLostError(WorkerError):
    """Another worker has the job now; this one stops without writing."""
