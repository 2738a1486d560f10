"""A collector of traces on loopback: takes OTLP over HTTP, and keeps it."""

import gzip
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler
from typing import Any

from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest
from support.servers.in_threads import Quiet, serving


class Collector:
    """What arrived.

    Attributes:
        paths: Where it was sent to.
        url: To send to.
    """

    def __init__(self) -> None:
        self.url = ""
        self.paths: set[str] = set()
        self.requests: list[ExportTraceServiceRequest] = []

    def spans(self) -> list[tuple[str, Any]]:
        """All spans, each with its service."""
        resources = [one for request in self.requests for one in request.resource_spans]
        scopes = [(self._service(one), scope) for one in resources for scope in one.scope_spans]
        return [(service, span) for service, scope in scopes for span in scope.spans]

    @staticmethod
    def _service(resource: Any) -> str:
        named = {each.key: each.value.string_value for each in resource.resource.attributes}
        return named["service.name"]


@contextmanager
def collector() -> Iterator[Collector]:
    """Takes traces until the block is left."""
    kept = Collector()

    class Handler(Quiet, BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            if self.headers.get("Content-Encoding") == "gzip":
                body = gzip.decompress(body)
            kept.paths.add(self.path)
            kept.requests.append(ExportTraceServiceRequest.FromString(body))
            self.send_response(200)
            self.end_headers()

    with serving(Handler) as kept.url:
        yield kept
