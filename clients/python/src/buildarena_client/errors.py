"""Errors of the client: what the service refuses, and what is no answer of it at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final


class ClientError(Exception):
    """Something that was asked for could not be had."""


class BadArgumentError(ClientError, ValueError):
    """An argument that can't be sent: a name that is none, a URL, a key. Nothing was sent."""


class MissingLibraryError(ClientError, ImportError):
    """A library is not installed; the message names the extra that installs it."""

    def __init__(self, what: str, *, library: str, extra: str) -> None:
        super().__init__(
            f"{what} needs {library}, which is not installed: "
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
    """The service says that it can't answer now (HTTP 503)."""


class NotAnApiError(ClientError):
    """What answers is not BuildArena: its answer is not JSON."""


class DamagedError(ClientError):
    """Bytes arrived with another hash than the stored ones."""


class RefusedError(ClientError):
    """The service refused a request.

    Attributes:
        status: The HTTP status.
        code: What went wrong, for programs; empty if the answer has none.
        detail: What went wrong, in one sentence.
        errors: What is wrong with the request: ``field``, ``message``, ``line`` and ``choices`` of
            each mistake.
    """

    def __init__(
        self, status: int, detail: str, errors: Sequence[Mapping[str, Any]] = (), *, code: str = ""
    ) -> None:
        super().__init__("\n".join(map(described, errors)) or detail)
        self.status, self.code = status, code
        self.detail = detail
        self.errors = [dict(error) for error in errors]


class KeyRefusedError(RefusedError):
    """There is no key, or it is not good, any more or at all (401)."""


class ForbiddenError(RefusedError):
    """The key may not do this (403)."""


class NotFoundError(RefusedError):
    """There is no such thing, or not yet (404)."""


class ConflictError(RefusedError):
    """Its state does not allow it (409)."""


class TooLargeError(RefusedError):
    """The request, or its answer, is larger than the service handles (413)."""


class InvalidError(RefusedError):
    """The request is wrong; ``errors`` says where, and what would be right (422)."""


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
    """The error for a status."""
    return KINDS.get(status, ServiceFaultError if status >= 500 else RefusedError)  # noqa: PLR2004


def described(error: Mapping[str, Any]) -> str:
    """One mistake in words, with what would be right."""
    line = f"{error['field']}: {error['message']}"
    return f"{line}; choose from {', '.join(error['choices'])}" if error["choices"] else line
