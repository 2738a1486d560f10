"""What can go wrong between a runner and the API."""

from __future__ import annotations


class RemoteError(Exception):
    """Base of what a runner's requests raise."""


class LeaseLostError(RemoteError):
    """The lease is over: another worker has the job, it was cancelled, or the runner shuts down."""


class RefusedError(RemoteError):
    """The API refuses what was asked, and would again.

    Attributes:
        status: The HTTP status.
    """

    def __init__(self, status: int, detail: str) -> None:
        super().__init__(detail)
        self.status = status

    @property
    def is_of_the_key(self) -> bool:
        """Whether the key is the reason, so that nothing else will be taken either."""
        return self.status in {401, 403}


class UnreachableError(RemoteError):
    """The API did not answer for as long as was waited for it."""
