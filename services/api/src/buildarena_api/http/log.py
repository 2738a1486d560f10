"""The request log: each request has an id, a line in the log, a place in the metrics, a span.

Each answer gets the security headers for browsers.
"""

from __future__ import annotations

import re
import secrets
import time
from contextlib import AbstractContextManager, nullcontext

import structlog
from opentelemetry.trace import INVALID_SPAN, Span, SpanKind
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from buildarena_api.http.metrics import ServiceMetrics
from buildarena_backend.telemetry.tracing import TRACEPARENT, mark_failed, span

REQUEST_ID = "X-Request-ID"
GOOD_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
QUIET = ("/v1/health", "/v1/metrics")
"""Paths that machines poll: not worth a line or a span each."""

SECURITY_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}

log = structlog.get_logger(__name__)


class RequestLog:
    """Middleware around the application."""

    def __init__(self, app: ASGIApp, metrics: ServiceMetrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on and log its result."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        header = headers.get(REQUEST_ID, "")
        request_id = header if GOOD_ID.fullmatch(header) else secrets.token_hex(8)
        status = 500
        started = time.perf_counter()

        async def noting_send(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                answered = MutableHeaders(scope=message)
                for name, value in SECURITY_HEADERS.items():
                    answered.setdefault(name, value)
                answered[REQUEST_ID] = request_id
                answered.update(scope.get("state", {}).get("rate", {}))
            await send(message)

        with (
            structlog.contextvars.bound_contextvars(request_id=request_id),
            _request_span(scope, headers.get(TRACEPARENT), request_id) as current,
        ):
            try:
                await self._app(scope, receive, noting_send)
            finally:
                self._note(scope, status, time.perf_counter() - started)
                _describe(current, scope, status)

    def _note(self, scope: Scope, status: int, seconds: float) -> None:
        route = _route(scope) or "none"
        self._metrics.http_seconds.labels(route, scope["method"], str(status)).observe(seconds)
        self._metrics.responses.labels(str(status)).inc()
        if scope["path"] not in QUIET:
            caller = scope.get("state", {}).get("caller")
            log.info(
                "request",
                method=scope["method"],
                path=scope["path"],
                status=status,
                seconds=round(seconds, 4),
                key=None if caller is None else caller.key_id,
            )


def _request_span(
    scope: Scope, traceparent: str | None, request_id: str
) -> AbstractContextManager[Span]:
    """Return a span that continues the caller's trace, if it has one; none for polled paths."""
    if scope["path"] in QUIET:
        return nullcontext(INVALID_SPAN)
    attributes = {
        "http.request.method": scope["method"],
        "url.path": scope["path"],
        "url.scheme": scope["scheme"],
        "buildarena.request_id": request_id,
    }
    return span("HTTP", attributes, parent=traceparent, kind=SpanKind.SERVER)


def _describe(current: Span, scope: Scope, status: int) -> None:
    route = _route(scope)
    if route is not None:
        current.update_name(f"{scope['method']} {route}")
        current.set_attribute("http.route", route)
    current.set_attribute("http.response.status_code", status)
    if status >= 500:  # noqa: PLR2004 - HTTP's errors of the server
        mark_failed(current, str(status))


def _route(scope: Scope) -> str | None:
    path: str | None = getattr(scope.get("route"), "path", None)
    return path
