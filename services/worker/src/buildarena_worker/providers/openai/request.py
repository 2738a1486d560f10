"""Requests in OpenAI's chat completions: our messages, tools and settings as its JSON.

Written from OpenAI's API reference. Bodies are compared with kept ones in
``tests/worker/providers/openai/test_requests.py``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from buildarena_worker.providers.openai.schema import function_tool
from buildarena_worker.session.messages import Message, Request

MAX_FRAMES = 256
"""Frames kept; a role needs one, and a process has few roles."""
SAMPLED = ("gpt-5-chat",)
"""Beginnings of names of models that take sampling parameters although others of their family
do not."""
REASONING = (
    "gpt-6-astra",
    "gpt-6-sol",
    "gpt-6-luna",
    "gpt-6.1-sol",
    "gpt-6.1-terra",
    "gpt-5.6",
    "gpt-5.5",
    "gpt-5.4-pro",
    "gpt-5.3-chat",
    "gpt-5.2-pro",
    "gpt-5.2-chat",
    "gpt-5.1-codex",
    "gpt-5.1-chat",
    "o1",
    "o3",
    "o4",
)
"""Beginnings of names of OpenAI's models that reason unless told not to, and refuse temperature
and top-p then. Source: OpenAI's guide to reasoning models."""
REASONING_GPT_5 = "gpt-5"
OPTIONAL_REASONING = "gpt-5."
"""Of the numbered successors of GPT-5, those not named above reason on request only."""


class RequestWriter:
    """Writes the requests to one model.

    What surrounds a request's messages and seed, its frame, is the same for all requests of a
    role and is written once.

    Args:
        model: The provider's name for the model.
    """

    def __init__(self, model: str) -> None:
        self._model = model
        self._takes_sampling = not _reasons(model)
        # The first small reasoning model has no system role. Source: OpenAI's guide to reasoning.
        self._system_role = "user" if model.startswith("o1-mini") else "system"
        self._frames: dict[str, str] = {}

    def body(self, request: Request) -> bytes:
        """The request's body."""
        messages = json.dumps(
            write_messages(request.messages, self._system_role), ensure_ascii=False
        )
        rest = self._frame(request)[1:]
        return f'{{"messages":{messages},"seed":{request.seed},{rest}'.encode()

    def _frame(self, request: Request) -> str:
        decoding = request.model_config["decoding"]
        tools = [[tool.name, tool.description, tool.parameters] for tool in request.tools]
        key = json.dumps([tools, decoding])
        frame = self._frames.get(key)
        if frame is None:
            if len(self._frames) >= MAX_FRAMES:
                self._frames.clear()
            frame = self._frames[key] = json.dumps(self._around(request), ensure_ascii=False)
        return frame

    def _around(self, request: Request) -> dict[str, Any]:
        decoding = request.model_config["decoding"]
        around: dict[str, Any] = {"model": self._model}
        if request.tools:
            around["parallel_tool_calls"] = False
            around["tools"] = [function_tool(tool) for tool in request.tools]
            around["tool_choice"] = "auto"
        around["stream"] = False
        if "max_tokens" in decoding:
            around["max_completion_tokens"] = decoding["max_tokens"]
        if self._takes_sampling:
            around |= {
                name: decoding[name] for name in ("temperature", "top_p") if name in decoding
            }
        return around


def write_messages(messages: Sequence[Message], system_role: str) -> list[dict[str, Any]]:
    """The conversation as the wire's ``messages``; one that says nothing is not allowed there."""
    return [_message(message, system_role) for message in messages if message.text or message.calls]


def _message(message: Message, system_role: str) -> dict[str, Any]:
    if message.role == "tool":
        return {
            "role": "tool",
            "tool_call_id": message.call_id or "",
            "content": message.text,
        }
    if message.role != "assistant":
        role = system_role if message.role == "system" else "user"
        return {"role": role, "content": message.text}
    written: dict[str, Any] = {"role": "assistant", "content": message.text or None}
    if message.calls:
        written["tool_calls"] = [
            {
                "id": call.id,
                "type": "function",
                "function": {"name": call.name, "arguments": call.arguments_json},
            }
            for call in message.calls
        ]
    return written


def _reasons(model: str) -> bool:
    if model.startswith(SAMPLED):
        return False
    if model.startswith(REASONING):
        return True
    return model.startswith(REASONING_GPT_5) and not model.startswith(OPTIONAL_REASONING)
