"""HTTP on httpx2 for both clients, and when a request is sent again. A client loads it when made.

A request that was refused as one too many (429) was not begun, so any may be sent again. After 503,
or a connection that broke off, a change may have been made: only what may be carried out twice is
sent again. Nothing is sent again after a time-out, which has cost long enough.
"""

from __future__ import annotations

import contextlib
import json
import ssl
import time
from collections.abc import AsyncGenerator, Mapping
from contextlib import AbstractAsyncContextManager
from http import HTTPStatus
from typing import Any, Final, cast

import httpx2

from buildarena_client.errors import (
    BadArgumentError,
    ClientError,
    KeyRefusedError,
    TimedOutError,
    UnavailableError,
    UnreachableError,
    kind_of,
)
from buildarena_client.event_streams import no_events
from buildarena_client.paths import HEALTH, checked_path
from buildarena_client.retries import RetryPolicy

LONGEST_PAUSE_S: Final = 10.0
"""Maximum pause before a refused request is repeated, whatever the service requests."""
BREAK_PAUSE_S: Final = 0.2
HIDDEN: Final = "[key]"


class Transport:
    """Sender of requests to one server, without redirects or proxies.

    Args:
        key: Key that is sent with each request, and omitted from messages.
        timeout_s: Maximum silence of the server, seconds; None for no limit.
        retries: Limits for repeating requests.
        at_once: Maximum number of open requests; further ones wait. Streams are not counted. None
            for a transport that blocks: its coroutines never suspend, so that ``client.run`` runs
            them without an event loop, and each request has its own connection, so that any thread
            may send one.

    Raises:
        BadArgumentError: The URL is invalid.
    """

    def __init__(
        self,
        url: str,
        key: str | None,
        *,
        timeout_s: float | None,
        retries: RetryPolicy,
        at_once: int | None,
    ) -> None:
        self._url = url
        self._key = key
        self._retries = retries
        self._blocks = at_once is None
        headers = {"Accept-Encoding": "identity"}
        if key:
            headers["Authorization"] = f"Bearer {key}"
        # An idle connection may outlive its event loop, and cannot be closed from another one.
        limits = httpx2.Limits(max_keepalive_connections=0)
        options: dict[str, Any] = {
            "limits": limits,
            "verify": ssl.create_default_context() if url.lower().startswith("https:") else False,
        }
        carrier: httpx2.AsyncBaseTransport
        if at_once is None:
            self._slots: AbstractAsyncContextManager[object] = contextlib.nullcontext()
            carrier = _BlockingCarrier(httpx2.HTTPTransport(**options))
        else:
            import asyncio  # which the command line does without

            self._slots = asyncio.Semaphore(at_once)
            carrier = httpx2.AsyncHTTPTransport(**options)
        try:
            # The environment's proxies and .netrc would see the key, or put another in its place.
            self._http = httpx2.AsyncClient(
                base_url=url, headers=headers, timeout=timeout_s, transport=carrier, trust_env=False
            )
        except httpx2.InvalidURL as error:
            raise BadArgumentError(f"{url!r} is not the URL of an API: {error}") from error

    async def answer(
        self,
        method: str,
        path: str,
        params: Mapping[str, Any],
        *,
        repeatable: bool = True,
        **more: Any,
    ) -> httpx2.Response:
        """Return the complete, successful response to a request; of health, any response.

        Args:
            method: GET, POST or PUT.
            path: Path below the service's URL.
            params: Query parameters; those that are None are left out, lists are repeated.
            repeatable: True if it may be sent again although it may have been executed.
            more: ``headers``, ``content`` or ``json``, as httpx2 takes them.

        Raises:
            ClientError: There is no successful response.
        """
        request = self._request(method, path, params, **more)
        async with self._slots:
            return await self._answered(request, repeatable=repeatable)

    @contextlib.asynccontextmanager
    async def opened(
        self, path: str, params: Mapping[str, Any], **more: Any
    ) -> AsyncGenerator[httpx2.Response, None]:
        """Yield the successful response to a GET for streaming, until its end or a ClientError."""
        request = self._request("GET", path, params, **more)
        answer = await self._answered(request, repeatable=True, stream=True)
        try:
            yield answer
        except httpx2.SSEError as error:
            raise no_events() from error
        except httpx2.RequestError as error:
            raise self._unreachable(error) from error
        finally:
            await answer.aclose()

    async def pause(self, seconds: float) -> None:
        """Wait before the next request."""
        if self._blocks:
            time.sleep(seconds)  # noqa: ASYNC251 - there is no event loop
        else:
            import asyncio

            await asyncio.sleep(seconds)

    async def close(self) -> None:
        """Close kept-alive connections."""
        if not self._blocks:
            await self._http.aclose()

    def _request(
        self,
        method: str,
        path: str,
        params: Mapping[str, Any],
        *,
        headers: Mapping[str, str] | None = None,
        **more: Any,
    ) -> httpx2.Request:
        for name, value in (headers or {}).items():
            if not (value.isascii() and value.isprintable()):
                raise BadArgumentError(f"{value!r} can't be sent as {name}: use printable ASCII")
        url = httpx2.URL(checked_path(path))
        if asked := {name: value for name, value in params.items() if value is not None}:
            url = url.copy_merge_params(asked)
        try:
            return self._http.build_request(method, url, headers=headers, **more)
        except (TypeError, ValueError, RecursionError) as error:
            raise BadArgumentError(f"this can't be sent as JSON: {error}") from error

    async def _answered(
        self, request: httpx2.Request, *, repeatable: bool, stream: bool = False
    ) -> httpx2.Response:
        now = time.monotonic()
        until: dict[int, float] = {HTTPStatus.TOO_MANY_REQUESTS: now + self._retries.too_many_s}
        if repeatable:
            until[HTTPStatus.SERVICE_UNAVAILABLE] = now + self._retries.unavailable_s
        breaks = self._retries.breaks if repeatable else 0
        while True:
            try:
                answer = await self._http.send(request, stream=stream)
                if answer.is_success or request.url.path.endswith(HEALTH):
                    return answer
                await answer.aread()
            except httpx2.RequestError as error:
                # There was a connection, and it is cut.
                cut = isinstance(error, (httpx2.NetworkError, httpx2.RemoteProtocolError))
                if not breaks or not cut or isinstance(error, httpx2.ConnectError):
                    raise self._unreachable(error) from error
                breaks -= 1
                pause_s = BREAK_PAUSE_S
            else:
                asked = answer.headers.get("Retry-After", "")
                pause_s = min(float(asked), LONGEST_PAUSE_S) if asked.isdecimal() else float("inf")
                if time.monotonic() + pause_s > until.get(answer.status_code, 0.0):
                    raise _failure(answer, self._key)
            await self.pause(pause_s)

    def _unreachable(self, error: httpx2.RequestError) -> UnreachableError:
        kind = TimedOutError if isinstance(error, httpx2.TimeoutException) else UnreachableError
        # Untrusted input: one line, and nothing that a terminal would obey.
        reason = str(error) or type(error).__name__
        text = "".join(char if char.isprintable() else " " for char in reason).strip()
        return kind(f"no BuildArena answers at {self._url} ({text})")


class _BlockingCarrier(httpx2.AsyncBaseTransport):
    """Carries a request out while it is awaited, without an event loop."""

    def __init__(self, transport: httpx2.HTTPTransport) -> None:
        self._transport = transport

    async def handle_async_request(self, request: httpx2.Request) -> httpx2.Response:
        answer = self._transport.handle_request(request)
        answer.stream = _BlockingStream(cast("httpx2.SyncByteStream", answer.stream))
        return answer


class _BlockingStream(httpx2.AsyncByteStream):
    def __init__(self, stream: httpx2.SyncByteStream) -> None:
        self._stream = stream

    async def __aiter__(self) -> AsyncGenerator[bytes, None]:
        for chunk in self._stream:
            yield chunk

    async def aclose(self) -> None:
        self._stream.close()


def _failure(answer: httpx2.Response, key: str | None) -> ClientError:
    """Return the error for a problem response, without the key, which a server may repeat."""
    detail, errors = f"HTTP {answer.status_code} from {answer.url}", list[dict[str, Any]]()
    code = ""
    text = answer.text.replace(json.dumps(key)[1:-1], HIDDEN) if key else answer.text
    with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError, RecursionError):
        problem = json.loads(text)
        errors = [_issue(error) for error in problem["errors"]]
        code = str(problem.get("code", ""))
        detail = str(problem["detail"])
    if answer.status_code == HTTPStatus.SERVICE_UNAVAILABLE:
        return UnavailableError(detail)
    kind = kind_of(answer.status_code)
    return kind(answer.status_code, detail, [] if kind is KeyRefusedError else errors, code=code)


def _issue(error: dict[str, Any]) -> dict[str, Any]:
    return {
        "field": str(error.get("field", "")),
        "message": str(error["message"]),
        "line": error.get("line"),
        "choices": [str(choice) for choice in error.get("choices") or ()],
    }
