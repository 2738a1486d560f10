"""Failures of a request to a provider, the same for all protocols."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from enum import StrEnum

from buildarena_backend.journal.journal import Usage
from buildarena_worker.session.messages import ONE_REQUEST


class Failure(StrEnum):
    """Kinds of failures; `provider` decides how to handle each."""

    OUTAGE = "outage"
    """The provider can't be reached or is overloaded: the request is retried."""
    GARBAGE = "garbage"
    """The provider answered, and may charge for it, but the answer can't be read."""
    CONTEXT_OVERFLOW = "context_overflow"
    """The conversation is longer than the model's context: the model's own failure."""
    CONTENT_FILTER = "content_filter"
    """The provider's filter stopped the request: the model's own failure as well."""
    BAD_CREDENTIALS = "bad_credentials"
    MODEL_NOT_FOUND = "model_not_found"
    QUOTA_EXCEEDED = "quota_exceeded"
    REQUEST_REFUSED = "request_refused"
    """Anything else that the provider will refuse again."""


RETRIED_STATUS = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 520, 522, 524, 529})
REFUSALS = {
    401: Failure.BAD_CREDENTIALS,
    402: Failure.QUOTA_EXCEEDED,
    403: Failure.BAD_CREDENTIALS,
    404: Failure.MODEL_NOT_FOUND,
}


def failure_of_status(status: int) -> Failure:
    """Return the failure that an HTTP status alone means."""
    if status in RETRIED_STATUS:
        return Failure.OUTAGE
    return REFUSALS.get(status, Failure.REQUEST_REFUSED)


@dataclass(eq=False)
class ProviderError(Exception):
    """A request that a provider did not answer.

    Attributes:
        failure: Kind of the failure.
        overloaded: Whether the provider reported too many requests.
        headers: The answer's headers in lower case, if there was an answer.
        usage: Use reported by the answer, as far as it can be read.
    """

    message: str
    failure: Failure
    _: KW_ONLY
    overloaded: bool = False
    headers: Mapping[str, str] | None = None
    usage: Usage = ONE_REQUEST

    def __str__(self) -> str:
        return self.message


def redirect_error(status: int, location: str | None) -> ProviderError:
    """Return the error of a redirect, which could send the API key to another address."""
    return ProviderError(
        f"HTTP {status}: the provider redirects to {location or 'nowhere'}, which is not followed; "
        "set its base_url to where its API is",
        Failure.REQUEST_REFUSED,
    )
