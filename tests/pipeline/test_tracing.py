"""Traces arrive at a collector, and a job's spans are one trace."""

from __future__ import annotations

import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

PROGRAM = """
import sys
from buildarena_pipeline.runtime.tracing import Tracing, span

tracing = Tracing("test", sys.argv[1])
for stage in ("construct", "simulate"):
    with span(stage, job="job_1"):
        with span("model request", role="builder"):
            pass
try:
    with span("construct", job="job_2"):
        raise ValueError("what a model wrote")
except ValueError:
    pass
tracing.close()
"""


class Collector(BaseHTTPRequestHandler):
    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        if self.headers.get("Content-Encoding") == "gzip":
            import gzip

            body = gzip.decompress(body)
        self.server.requests.append((self.path, ExportTraceServiceRequest.FromString(body)))
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Says nothing."""


def test_a_jobs_spans_are_one_trace_at_the_collector() -> None:
    server = HTTPServer(("127.0.0.1", 0), Collector)
    server.requests = []
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        url = f"http://127.0.0.1:{server.server_port}"
        # A process of its own: a tracer provider is set once in a process.
        subprocess.run([sys.executable, "-c", PROGRAM, url], check=True, timeout=60)
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    assert {path for path, _ in server.requests} == {"/v1/traces"}
    spans = [
        span
        for _, request in server.requests
        for resource in request.resource_spans
        for scope in resource.scope_spans
        for span in scope.spans
    ]
    assert len(spans) == 5
    traces = {span.trace_id for span in spans}
    assert len(traces) == 2, "two jobs, two traces"
    assert "what a model wrote" not in str(server.requests)
    failed = [span for span in spans if span.status.message == "ValueError"]
    assert [span.name for span in failed] == ["construct"]
