"""A stand-in for an OpenAI-compatible endpoint: plays scripts by how far a conversation is.

The first reply of a conversation chooses the next script of its task; the ids of its tool calls
say which it was, so that the endpoint needs no memory of conversations.
"""

import json
import re
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler
from typing import Any

from support.servers import in_threads

Script = Sequence[Any]
"""Tool calls, each with `tool` and `arguments`, or several in a list; text is said instead of a
call, and a number is waited for, in seconds."""


class StandIn:
    """Plays scripts.

    Args:
        scripts: By task, what its rollouts play, in turn.
    """

    def __init__(self, scripts: Mapping[str, Sequence[Script]]) -> None:
        self.scripts = scripts
        self.begun: Counter[str] = Counter()
        self.requests: list[dict[str, Any]] = []
        self.url = ""
        self._lock = threading.Lock()

    def reply(self, request: Mapping[str, Any]) -> dict[str, Any]:
        messages = request["messages"]
        task = re.search(r"# Task: (\S+)", messages[0]["content"])[1]
        said = [message for message in messages if message["role"] == "assistant"]
        known = [call["id"] for message in said for call in message.get("tool_calls") or []]
        if known:
            number = int(known[0].split("-")[1])
        else:
            with self._lock:
                number = self.begun[task]
                if not said:
                    self.begun[task] += 1
                else:
                    number -= 1
        script = self.scripts[task][number % len(self.scripts[task])]
        if len(said) >= len(script):
            return {"role": "assistant", "content": "That is all."}
        step = script[len(said)]
        if isinstance(step, float):
            time.sleep(step)
            step = "That took a while."
        if isinstance(step, str):
            return {"role": "assistant", "content": step}
        steps = step if isinstance(step, list) else [step]
        ids = [f"script-{number}-{len(said)}-{place}" for place in range(len(steps))]
        made = [{"name": one["tool"], "arguments": _text(one["arguments"])} for one in steps]
        calls = zip(ids, made, strict=True)
        used = [{"id": id_, "type": "function", "function": one} for id_, one in calls]
        return {"role": "assistant", "content": None, "tool_calls": used}


def _text(arguments: Any) -> str:
    return arguments if isinstance(arguments, str) else json.dumps(arguments)


@contextmanager
def serving(scripts: Mapping[str, Sequence[Script]]) -> Iterator[StandIn]:
    stand_in = StandIn(scripts)

    class Handler(in_threads.Quiet, BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        disable_nagle_algorithm = True

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            request = json.loads(body)
            stand_in.requests.append(request)
            answer = {
                "id": "stand-in",
                "object": "chat.completion",
                "created": 0,
                "model": request["model"],
                "choices": [
                    {"index": 0, "finish_reason": "stop", "message": stand_in.reply(request)}
                ],
                "usage": {"prompt_tokens": 1, "completion_tokens": 1, "total_tokens": 2},
            }
            sent = json.dumps(answer).encode()
            self.send_response(200)
            self.send_header("content-type", "application/json")
            self.send_header("content-length", str(len(sent)))
            self.end_headers()
            self.wfile.write(sent)

    with in_threads.serving(Handler) as url:
        stand_in.url = f"{url}/v1"
        yield stand_in
