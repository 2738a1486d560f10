"""A model provider on loopback that speaks OpenAI's, Anthropic's and Google's wire formats.

Behind the wire plays a built-in model, from nothing but what the wire carries. It counts what it
answered, so that accounts can be compared, and fails on demand.
"""

import contextlib
import gzip
import json
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler
from typing import Any, Self

from support.servers.in_threads import Quiet, serving

from buildarena_geometry import ToolDefinition
from buildarena_worker.builtin import MODELS
from buildarena_worker.session.messages import Completion, Message, Request, ToolCall

Fault = Callable[[int], str | bytes | None]
"""From the number of a request to what goes wrong: '429', '500', 'drop', 'slow', 'hang', 'drip',
…; bytes are a body that is sent with 200."""
DRIP_S = 0.05


@dataclass
class Counts:
    """What the stand-in answered."""

    requests: int = 0
    answered: int = 0
    input_tokens: int = 0
    output_tokens: int = 0
    cached_tokens: int = 0
    bodies: list[dict[str, Any]] = field(default_factory=list)
    headers: list[dict[str, str]] = field(default_factory=list)


class ProviderStandIn:
    """A server to be used as a context manager.

    Args:
        model: Built-in model that answers.
        fault: What goes wrong with each request.
        latency_s: Time each answer takes.
        elsewhere: Where redirects lead.
        respond: Answers in the built-in model's place.
    """

    def __init__(
        self,
        model: str = "expert",
        *,
        fault: Fault = lambda _: None,
        latency_s: float = 0.0,
        elsewhere: str = "http://127.0.0.1:9/",
        respond: Callable[[Request], Completion] | None = None,
    ) -> None:
        self.elsewhere = elsewhere
        self.counts = Counts()
        self.lock = threading.Lock()
        self.respond = respond or MODELS[model]
        self.fault = fault
        self.latency_s = latency_s
        self._serving = serving(type("Handler", (_Handler,), {"standin": self}))
        self.closing = threading.Event()
        self.left = 0

    def __enter__(self) -> Self:
        self.url = self._serving.__enter__()
        return self

    def __exit__(self, *given: object) -> None:
        self.closing.set()
        self._serving.__exit__(None, None, None)


class _Handler(Quiet, BaseHTTPRequestHandler):
    standin: ProviderStandIn
    protocol_version = "HTTP/1.1"
    # An answer has two writes; the second would wait 40 ms until the first is acknowledged.
    disable_nagle_algorithm = True

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["content-length"])))
        counts = self.standin.counts
        with self.standin.lock:
            number = counts.requests
            counts.requests += 1
            counts.bodies.append(body)
            counts.headers.append({name.lower(): v for name, v in self.headers.items()})
        fault = self.standin.fault(number)
        if self._misbehaves(fault):
            return
        if fault == "drop":
            self.connection.shutdown(socket.SHUT_RDWR)
            self.close_connection = True
            return
        if fault in {"429", "429 gzip", "500", "503", "401", "404"}:
            # Some providers repeat the key that they refuse.
            names = ("authorization", "x-api-key", "x-goog-api-key")
            keys = [self.headers[name] for name in names if self.headers[name]]
            message = f"stand-in says no to {keys}"
            error = {"error": {"message": message, "type": "error", "status": "X"}}
            headers = {"retry-after": "0"} if "429" in fault else {}
            if "gzip" in fault:
                headers["content-encoding"] = "gzip"
            self._send(int(fault[:3]), error, headers)
            return
        if fault == "overflow":
            message = "This model's maximum context length is 8192 tokens."
            code = {"message": message, "type": "invalid_request_error"}
            self._send(400, {"error": {**code, "code": "context_length_exceeded"}}, {})
            return
        if fault == "garbage":
            self._send(200, {"nothing": "here"}, {})
            return
        time.sleep(5.0 if fault == "slow" else self.standin.latency_s)
        wire = _WIRES[_wire_of(self.path)]
        reply = self.standin.respond(wire.read(body))
        used = _used(body, reply)
        with self.standin.lock:
            counts.answered += 1
            counts.input_tokens += used[0]
            counts.output_tokens += used[1]
            counts.cached_tokens += used[2]
        self._send(200, wire.write(reply, used, number), {})

    def _misbehaves(self, fault: str | bytes | None) -> bool:
        """Does what no honest provider does, if that is the fault."""
        if isinstance(fault, bytes):
            self._send_bytes(200, fault, {})
        elif fault in {"hang", "drip"}:
            self._keep_waiting(drips=fault == "drip")
        elif fault in {"301", "302", "303", "307", "308"}:
            self._send(int(fault), {}, {"location": self.standin.elsewhere})
        else:
            return False
        return True

    def _keep_waiting(self, *, drips: bool) -> None:
        """Never answers, or a byte at a time; notes when the client has gone."""
        with contextlib.suppress(ConnectionError):
            if drips:
                self.send_response(200)
                self.send_header("content-length", "1000000")
                self.end_headers()
            self.connection.settimeout(DRIP_S)
            while not self.standin.closing.is_set():
                if drips:
                    self.wfile.write(b" ")
                with contextlib.suppress(TimeoutError):
                    if not self.connection.recv(1):
                        break
        with self.standin.lock:
            self.standin.left += 1
        self.close_connection = True

    def _send(self, status: int, body: dict[str, Any], headers: dict[str, str]) -> None:
        self._send_bytes(status, json.dumps(body).encode(), headers)

    def _send_bytes(self, status: int, data: bytes, headers: dict[str, str]) -> None:
        if headers.get("content-encoding") == "gzip":
            data = gzip.compress(data)
        self.send_response(status)
        for name, value in {"content-type": "application/json", **headers}.items():
            self.send_header(name, value)
        self.send_header("content-length", str(len(data)))
        with contextlib.suppress(ConnectionError):  # a client that gave up waiting
            self.end_headers()
            self.wfile.write(data)


def _wire_of(path: str) -> str:
    if "generateContent" in path:
        return "google"
    return "anthropic" if path.endswith("/messages") else "openai"


def _used(body: dict[str, Any], reply: Completion) -> tuple[int, int, int]:
    """Input, output and cached tokens: any exact rule will do."""
    size = len(json.dumps(body.get("messages") or body.get("contents")))
    return size // 4, 1 + len(json.dumps(reply.to_json())) // 4, size // 16


class OpenAIWire:
    """OpenAI's chat completions, from the provider's side."""

    @staticmethod
    def read(body: dict[str, Any]) -> Request:
        messages = []
        for m in body["messages"]:
            made = [(c["id"], c["function"]) for c in m.get("tool_calls") or ()]
            read = [(id_, one["name"], json.loads(one["arguments"])) for id_, one in made]
            calls = tuple(ToolCall(id=id_, name=name, arguments=given) for id_, name, given in read)
            role = "system" if m["role"] in {"system", "developer"} else m["role"]
            text, call_id = _text(m.get("content")), m.get("tool_call_id")
            messages.append(Message(role=role, text=text, calls=calls, call_id=call_id))
        given = [t["function"] for t in body.get("tools") or ()]
        told = [(one["name"], one.get("description", ""), one["parameters"]) for one in given]
        tools = [ToolDefinition(name=n, description=d, parameters=p) for n, d, p in told]
        seed = int(body.get("seed") or 0)
        return Request(model_config={}, messages=messages, tools=tools, seed=seed)

    @staticmethod
    def write(reply: Completion, used: tuple[int, int, int], number: int) -> dict[str, Any]:
        made = [(c.id, {"name": c.name, "arguments": json.dumps(c.arguments)}) for c in reply.calls]
        calls = [{"id": id_, "type": "function", "function": function} for id_, function in made]
        message = {"role": "assistant", "content": reply.text or None}
        if calls:
            message["tool_calls"] = calls
        choice = {"index": 0, "finish_reason": "tool_calls" if calls else reply.finish}
        usage = {"prompt_tokens": used[0], "completion_tokens": used[1]}
        usage |= {
            "total_tokens": used[0] + used[1],
            "prompt_tokens_details": {"cached_tokens": used[2]},
        }
        said = {"choices": [{**choice, "message": message}], "usage": usage, "model": "standin"}
        return {"id": f"standin-{number}", "object": "chat.completion", "created": 1, **said}


class _Anthropic:
    @staticmethod
    def read(body: dict[str, Any]) -> Request:
        messages = [Message(role="system", text=_text(body.get("system")))]
        for m in body["messages"]:
            parts = m["content"] if isinstance(m["content"], list) else [_part(m["content"])]
            used = [p for p in parts if p["type"] == "tool_use"]
            calls = tuple(ToolCall(id=p["id"], name=p["name"], arguments=p["input"]) for p in used)
            results = [p for p in parts if p["type"] == "tool_result"]
            told = [(_text(p.get("content")), p["tool_use_id"]) for p in results]
            messages += [Message(role="tool", text=text, call_id=call_id) for text, call_id in told]
            said = "\n\n".join(p["text"] for p in parts if p["type"] == "text")
            if said or calls:
                messages.append(Message(role=m["role"], text=said, calls=calls))
        given = [
            (t["name"], t.get("description", ""), t["input_schema"])
            for t in body.get("tools") or ()
        ]
        tools = [ToolDefinition(name=n, description=d, parameters=p) for n, d, p in given]
        return Request(model_config={}, messages=messages, tools=tools)

    @staticmethod
    def write(reply: Completion, used: tuple[int, int, int], number: int) -> dict[str, Any]:
        content: list[dict[str, Any]] = [_part(reply.text)] if reply.text else []
        uses = [{"id": c.id, "name": c.name, "input": c.arguments} for c in reply.calls]
        content += [{"type": "tool_use", **one} for one in uses]
        usage = {"input_tokens": used[0] - used[2], "output_tokens": used[1]}
        usage |= {"cache_read_input_tokens": used[2], "cache_creation_input_tokens": 0}
        end = {"stop_reason": "tool_use" if reply.calls else "end_turn", "stop_sequence": None}
        said = {"type": "message", "role": "assistant", "content": content, "usage": usage}
        return {"id": f"standin-{number}", "model": "standin", **end, **said}


class _Google:
    @staticmethod
    def read(body: dict[str, Any]) -> Request:
        system = body.get("systemInstruction") or {"parts": []}
        messages = [Message(role="system", text=_texts(system["parts"]))]
        for content in body["contents"]:
            parts = content["parts"]
            used = [p["functionCall"] for p in parts if "functionCall" in p]
            told = [(one.get("id", "x"), one["name"], one.get("args", {})) for one in used]
            calls = tuple(ToolCall(id=id_, name=name, arguments=given) for id_, name, given in told)
            told = [p["functionResponse"]["response"] for p in parts if "functionResponse" in p]
            messages += [Message(role="tool", text=json.dumps(response)) for response in told]
            said = _texts(parts)
            if said or calls:
                role = "assistant" if content.get("role") == "model" else "user"
                messages.append(Message(role=role, text=said, calls=calls))
        tools = [
            ToolDefinition(
                name=f["name"],
                description=f.get("description", ""),
                parameters=f.get("parametersJsonSchema") or f.get("parameters") or {},
            )
            for t in body.get("tools") or ()
            for f in t.get("functionDeclarations") or ()
        ]
        seed = (body.get("generationConfig") or {}).get("seed") or 0
        return Request(model_config={}, messages=messages, tools=tools, seed=int(seed))

    @staticmethod
    def write(reply: Completion, used: tuple[int, int, int], number: int) -> dict[str, Any]:
        parts: list[dict[str, Any]] = [{"text": reply.text}] if reply.text else []
        parts += [{"functionCall": {"name": c.name, "args": c.arguments}} for c in reply.calls]
        candidate = {"content": {"role": "model", "parts": parts}, "finishReason": "STOP"}
        usage = {"promptTokenCount": used[0], "candidatesTokenCount": used[1]}
        usage |= {"totalTokenCount": used[0] + used[1], "cachedContentTokenCount": used[2]}
        said = {"candidates": [candidate], "usageMetadata": usage}
        return {"responseId": f"standin-{number}", "modelVersion": "standin", **said}


_WIRES: dict[str, Any] = {"openai": OpenAIWire, "anthropic": _Anthropic, "google": _Google}


def _part(text: str) -> dict[str, Any]:
    return {"type": "text", "text": text}


def _text(content: Any) -> str:
    if isinstance(content, list):
        return "\n\n".join(part.get("text", "") for part in content)
    return content or ""


def _texts(parts: list[dict[str, Any]]) -> str:
    return "\n\n".join(part["text"] for part in parts if "text" in part)
