"""HTTP client for the providers' own libraries, with bounded answers and without redirects."""

from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

import httpx2

from buildarena_backend.journal.journal import Usage
from buildarena_geometry.json_texts import is_too_deep, read_json
from buildarena_worker.providers.failures import Failure, ProviderError, redirect_error
from buildarena_worker.providers.response_limits import MAX_BODY, usage_of
from buildarena_worker.session.messages import ONE_REQUEST

USAGE = {
    "usage": ("input_tokens", "output_tokens", "cache_read_input_tokens"),
    "usageMetadata": ("promptTokenCount", "candidatesTokenCount", "cachedContentTokenCount"),
}
"""Fields of Anthropic's and Google's answers that report the use of tokens."""


@dataclass(slots=True)
class Received:
    """The unparsed answer to the current request.

    Attributes:
        answer: The answer, its body cut off after MAX_BODY bytes; None until it is complete.
    """

    answer: httpx2.Response | None = None

    def require_usable(self) -> None:
        """Check limits that the libraries do not check.

        Raises:
            ProviderError: It is a redirect, too long, or nests too deep.
        """
        if self.answer is None:
            return
        status, body = self.answer.status_code, self.answer.content
        if HTTPStatus.MULTIPLE_CHOICES <= status < HTTPStatus.BAD_REQUEST:
            raise redirect_error(status, self.answer.headers.get("location"))
        if self.succeeded and len(body) > MAX_BODY:
            raise ProviderError(f"the answer is longer than {MAX_BODY:,} bytes", Failure.GARBAGE)
        if self.succeeded and is_too_deep(body):
            raise ProviderError("the answer nests too deep to be read", Failure.GARBAGE)

    @property
    def succeeded(self) -> bool:
        """True if the status reports success."""
        return self.answer is not None and self.answer.is_success

    def usage(self) -> Usage:
        """Return the use that the answer reports, as far as it is readable."""
        try:
            answer = read_json(b"" if self.answer is None else self.answer.content)
        except ValueError:
            return ONE_REQUEST
        for name, (sent, received, cached) in USAGE.items():
            usage = answer.get(name) if isinstance(answer, dict) else None
            if isinstance(usage, Mapping):
                return usage_of(usage.get(sent), usage.get(received), usage.get(cached), 0)
        return ONE_REQUEST


RECEIVED: ContextVar[Received] = ContextVar("received")
"""The answer as the client received it, for the caller that waits for the library's view of it."""


class LimitedClient(httpx2.AsyncClient):
    """HTTP client that cuts off long answers and follows no redirect."""

    async def send(self, request: httpx2.Request, **options: Any) -> httpx2.Response:
        """Send a request and read its answer."""
        options |= {"stream": True, "follow_redirects": False}
        response = await super().send(request, **options)
        body = bytearray()
        try:
            async for part in response.aiter_bytes():
                body += part
                if len(body) > MAX_BODY:
                    break
        finally:
            await response.aclose()
        dropped = {"content-encoding", "content-length", "transfer-encoding"}
        headers = [(k, v) for k, v in response.headers.multi_items() if k.lower() not in dropped]
        status, received = response.status_code, RECEIVED.get(Received())
        received.answer = httpx2.Response(
            status, headers=headers, content=bytes(body), request=request
        )
        received.require_usable()
        return received.answer
