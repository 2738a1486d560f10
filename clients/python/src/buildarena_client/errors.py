"""Errors of the client: refusals by the service, and responses that are not the service's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final


class ClientError(Exception):
    """A failed request."""


class BadArgumentError(ClientError, ValueError):
    """An argument that can't be sent: a name that is none, a URL, a key. Nothing was sent."""


class MissingLibraryError(ClientError, ImportError):
    """A library is not installed; the message names the extra that installs it."""

    def __init__(self, purpose: str, *, library: str, extra: str) -> None:
        super().__init__(
            f"{purpose} needs {library}, which is not installed: "
            f"pip install 'buildarena-client[{extra}]'"
        )


class UnreachableError(ClientError):
    """The service does not answer now; it may later.

    Of a request that changes something it is not known whether it was carried out, unless the
    connection was refused.
    """


class TimedOutError(UnreachableError):
    """No byte came for as long as the client waits."""


class UnavailableError(UnreachableError):
    """The service reports that it is unavailable now (HTTP 503)."""


class NotAnApiError(ClientError):
    """The server is not BuildArena: its response is not JSON."""


class DamagedError(ClientError):
    """Bytes arrived with another hash than the stored ones."""


class RefusedError(ClientError):
    """The service refused a request.

    Attributes:
        code: Error code; empty if the response has none.
        detail: Description of the error, in one sentence.
        errors: Mistakes in the request: ``field``, ``message``, ``line`` and ``choices`` of each.
    """

    def __init__(
        self, status: int, detail: str, errors: Sequence[Mapping[str, Any]] = (), *, code: str = ""
    ) -> None:
        super().__init__("\n".join(map(described, errors)) or detail)
        self.status, self.code = status, code
        self.detail = detail
        self.errors = [dict(error) for error in errors]


class KeyRefusedError(RefusedError):
    """The key is missing, invalid or expired (401)."""


class ForbiddenError(RefusedError):
    """The key may not do this (403)."""


class NotFoundError(RefusedError):
    """The object does not exist, or not yet (404)."""


class ConflictError(RefusedError):
    """Its state does not allow it (409)."""


class TooLargeError(RefusedError):
    """The request, or its answer, is larger than the service handles (413)."""


class InvalidError(RefusedError):
    """The request is invalid; ``errors`` has the fields and valid values (422)."""


class TooManyRequestsError(RefusedError):
    """More than the caller may have, for longer than the client waits (429)."""


class ServiceFaultError(RefusedError):
    """Something went wrong in the service (5xx, but for 503)."""


KINDS: Final[Mapping[int, type[RefusedError]]] = {
    401: KeyRefusedError,
    403: ForbiddenError,
    404: NotFoundError,
    409: ConflictError,
    413: TooLargeError,
    422: InvalidError,
    429: TooManyRequestsError,
}
"""Errors by status."""


def kind_of(status: int) -> type[RefusedError]:
    """Return the error for a status."""
    return KINDS.get(status, ServiceFaultError if status >= 500 else RefusedError)  # noqa: PLR2004


def described(error: Mapping[str, Any]) -> str:
    """Describe one mistake, with the valid choices."""
    line = f"{error['field']}: {error['message']}"
    return f"{line}; choose from {', '.join(error['choices'])}" if error["choices"] else line
