"""What a database is asked, for tests that count it."""

from collections.abc import Iterator
from contextlib import contextmanager

from opentelemetry import trace
from opentelemetry.sdk.trace import ReadableSpan, TracerProvider
from opentelemetry.sdk.trace.export import SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter
from opentelemetry.sdk.trace.sampling import Sampler
from sqlalchemy import Engine, event


@contextmanager
def statements_of(engine: Engine) -> Iterator[list[str]]:
    """The statements that an engine's connections send meanwhile."""
    asked: list[str] = []

    def note(*arguments: object) -> None:
        asked.append(str(arguments[2]))

    event.listen(engine, "before_cursor_execute", note)
    try:
        yield asked
    finally:
        event.remove(engine, "before_cursor_execute", note)


class Spans:
    """What was recorded."""

    def __init__(self) -> None:
        self.exporter = InMemorySpanExporter()

    def named(self, *names: str) -> list[ReadableSpan]:
        """Those of some names, in the order in which they ended."""
        return [s for s in self.exporter.get_finished_spans() if s.name in names]

    def all(self) -> list[ReadableSpan]:
        return list(self.exporter.get_finished_spans())


@contextmanager
def recorded(sampler: Sampler | None = None) -> Iterator[Spans]:
    """Records spans inside the block: a provider is set once in a process otherwise."""
    spans = Spans()
    provider = TracerProvider(sampler=sampler)
    provider.add_span_processor(SimpleSpanProcessor(spans.exporter))
    before = trace._TRACER_PROVIDER
    trace._TRACER_PROVIDER = provider
    try:
        yield spans
    finally:
        trace._TRACER_PROVIDER = before
        provider.shutdown()
