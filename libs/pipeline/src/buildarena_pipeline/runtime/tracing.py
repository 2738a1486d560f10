"""Traces by OpenTelemetry, when an endpoint is configured; otherwise spans cost next to nothing.

All spans of one job are one trace, whichever processes made them: its id is made from the job's.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager

from opentelemetry import trace
from opentelemetry.context import Context
from opentelemetry.trace import NonRecordingSpan, SpanContext, Status, StatusCode, TraceFlags

from buildarena_pipeline.errors import StartupError

Attribute = str | int | float | bool


class Tracing:
    """Sends spans to a collector.

    Args:
        service: The process' name in traces, for example ``api``.
        endpoint: Where the collector takes OTLP over HTTP, for example
            ``http://127.0.0.1:4318``; None to send nothing.

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
                "install buildarena-pipeline[tracing]"
            ) from error
        provider = TracerProvider(
            resource=Resource.create({"service.name": f"buildarena-{service}"})
        )
        exporter = OTLPSpanExporter(endpoint=endpoint.rstrip("/") + "/v1/traces")
        provider.add_span_processor(BatchSpanProcessor(exporter))
        trace.set_tracer_provider(provider)
        self._provider = provider

    def close(self) -> None:
        """Sends what has not been sent."""
        if self._provider is not None:
            self._provider.shutdown()


@contextmanager
def span(name: str, *, job: str | None = None, **attributes: Attribute) -> Iterator[None]:
    """A span around the block.

    Args:
        name: What is done.
        job: Id of the job it is done for, whose trace it then belongs to.
        attributes: What is known of it.
    """
    tracer = trace.get_tracer("buildarena")
    known = {f"buildarena.{key}": value for key, value in attributes.items()}
    if job is not None:
        known["buildarena.job"] = job
    parent = None if job is None else _trace_of(job)
    with tracer.start_as_current_span(
        name,
        context=parent,
        attributes=known,
        record_exception=False,
        set_status_on_exception=False,
    ) as current:
        try:
            yield
        except Exception as error:
            # The class alone: messages may hold what a model or a person wrote.
            current.set_status(Status(StatusCode.ERROR, type(error).__name__))
            raise


def _trace_of(job_id: str) -> Context:
    digest = hashlib.sha256(job_id.encode()).digest()
    parent = SpanContext(
        trace_id=int.from_bytes(digest[:16], "big"),
        span_id=int.from_bytes(digest[16:24], "big"),
        is_remote=True,
        trace_flags=TraceFlags(TraceFlags.SAMPLED),
    )
    return trace.set_span_in_context(NonRecordingSpan(parent))
