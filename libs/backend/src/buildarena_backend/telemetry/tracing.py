"""Traces by OpenTelemetry, when an endpoint is configured; otherwise spans cost next to nothing.

A submission's request is the root, or continues its caller's trace. The job keeps that span as a
W3C ``traceparent``, and whatever is done for the job, in whichever process, is a child of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

from opentelemetry import trace
from opentelemetry.context import Context
from opentelemetry.trace import Span, SpanKind, Status, StatusCode
from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

from buildarena_backend import __version__
from buildarena_backend.errors import PermanentError, StartupError, TransientError

Attribute = str | int | float | bool

TRACEPARENT: Final = "traceparent"
ERROR_TYPE: Final = "error.type"
# Only this: callers' baggage is not passed on.
_PROPAGATOR: Final = TraceContextTextMapPropagator()


class Tracing:
    """Sends spans to a collector; OTEL_TRACES_SAMPLER says which, all by default.

    Args:
        service: The process' name in traces, for example ``api``.
        endpoint: OTLP collector over HTTP, for example ``http://127.0.0.1:4318``; None to send
            nothing.

    Raises:
        StartupError: An endpoint is set but OpenTelemetry's SDK is not installed.
    """

    def __init__(self, service: str, endpoint: str | None) -> None:
        self._provider = None
        if endpoint is None:
            return
        try:
            from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
            from opentelemetry.sdk.resources import Resource
            from opentelemetry.sdk.trace import TracerProvider
            from opentelemetry.sdk.trace.export import BatchSpanProcessor
        except ImportError as error:
            raise StartupError(
                "BUILDARENA_OTLP_ENDPOINT is set, which needs OpenTelemetry's SDK: "
                "install buildarena[tracing]"
            ) from error
        provider = TracerProvider(
            resource=Resource.create(
                {"service.name": f"buildarena-{service}", "service.version": __version__}
            )
        )
        exporter = OTLPSpanExporter(endpoint=endpoint.rstrip("/") + "/v1/traces")
        provider.add_span_processor(BatchSpanProcessor(exporter))
        trace.set_tracer_provider(provider)
        self._provider = provider

    def close(self) -> None:
        """Send all pending spans."""
        if self._provider is not None:
            self._provider.shutdown()


@contextmanager
def span(
    name: str,
    attributes: Mapping[str, Attribute],
    *,
    parent: str | None = None,
    kind: SpanKind = SpanKind.INTERNAL,
) -> Iterator[Span]:
    """Yield a span around the block, which fails when an exception leaves it.

    Args:
        parent: The ``traceparent`` of the span that it is a part of, which may be another process';
            one that can't be read counts as none, and None means the span around the block.
        kind: Its part in an exchange between processes.
    """
    tracer = trace.get_tracer("buildarena")
    around = None if parent is None else _PROPAGATOR.extract({TRACEPARENT: parent}, Context())
    with tracer.start_as_current_span(
        name,
        context=around,
        kind=kind,
        attributes=attributes,
        record_exception=False,
        set_status_on_exception=False,
    ) as current:
        try:
            yield current
        except Exception as error:
            # The class alone: messages may hold what a model or a person wrote.
            reason = named = type(error).__name__
            if isinstance(error, TransientError | PermanentError):
                reason = error.reason
            mark_failed(current, reason, named)
            raise


def mark_failed(failed: Span, kind: str, description: str | None = None) -> None:
    """Mark a span as failed.

    Args:
        kind: The class of the failure, one of few.
        description: More of it, without what a model or a person wrote.
    """
    failed.set_attribute(ERROR_TYPE, kind)
    failed.set_status(Status(StatusCode.ERROR, description))


def note(event: str, attributes: Mapping[str, Attribute]) -> None:
    """Note in the span around it that something happened at this moment."""
    trace.get_current_span().add_event(event, attributes)


def current_traceparent() -> str | None:
    """Return the span around it as a W3C ``traceparent``; None outside of any."""
    carrier: dict[str, str] = {}
    _PROPAGATOR.inject(carrier)
    return carrier.get(TRACEPARENT)
