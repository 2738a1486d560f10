"""An OpenAI-compatible endpoint on loopback, whose answers the policy writes.

It remembers nothing: an answer follows from the weights, the conversation and the request's `seed`.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
from languages import Call, said
from network import Writer


def answered(writer: Writer, request: Mapping[str, Any]) -> dict[str, Any]:
    """The completion of a request; the first message of a conversation is the opening."""
    messages = said(request["messages"])
    turn = sum(message.role == "assistant" for message in messages)
    calls = writer.language.opening
    if turn:
        conversation, _ = writer.language.read(messages)
        draw = np.random.default_rng([request["seed"], turn])
        calls = writer.language.calls(writer.message(conversation, draw))
    return {
        "id": f"turn-{turn}",
        "object": "chat.completion",
        "created": 0,
        "model": request["model"],
        "choices": [{"index": 0, "finish_reason": "tool_calls", "message": _message(calls, turn)}],
        "usage": {"prompt_tokens": 0, "completion_tokens": 0, "total_tokens": 0},
    }


def _message(calls: tuple[Call, ...], turn: int) -> dict[str, Any]:
    made = [
        {
            "id": f"call-{turn}-{number}",
            "type": "function",
            "function": {"name": call.tool, "arguments": json.dumps(call.arguments)},
        }
        for number, call in enumerate(calls)
    ]
    return {"role": "assistant", "content": None, "tool_calls": made}


@contextmanager
def serving(writer: Writer) -> Iterator[str]:
    """Serves completions; the address is for clients that speak OpenAI's protocol."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        disable_nagle_algorithm = True

        def do_POST(self) -> None:
            request = json.loads(self.rfile.read(int(self.headers["content-length"])))
            sent = json.dumps(answered(writer, request)).encode()
            self.send_response(200)
            self.send_header("content-type", "application/json")
            self.send_header("content-length", str(len(sent)))
            self.end_headers()
            self.wfile.write(sent)

        def log_message(self, *_: object) -> None:
            """Says nothing of requests."""

    class Server(ThreadingHTTPServer):
        request_queue_size = 256
        daemon_threads = True

    server = Server(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/v1"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
