"""OpenAI's chat completions as JSON: our messages written, plain answers read.

Written from OpenAI's API reference. What providers add to it is not read here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic_ai.usage import RequestUsage

from buildarena_worker.providers.wire import Answered, arguments_of, arguments_text
from buildarena_worker.session.messages import Message, Reply, ToolCall

FINISH = {
    "stop": "stop",
    "tool_calls": "stop",
    "length": "length",
    "content_filter": "content_filter",
}
THINKING = "<think"
"""Some models write their reasoning into the text, within tags that begin so."""


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
    said: dict[str, Any] = {"role": "assistant", "content": message.text or None}
    if message.calls:
        said["tool_calls"] = [
            {
                "id": call.id,
                "type": "function",
                "function": {"name": call.name, "arguments": arguments_text(call)},
            }
            for call in message.calls
        ]
    return said


def read_answer(text: bytes, *, provider_url: str) -> Answered | None:
    """A plain answer; None for every other, which takes more knowledge to read."""
    try:
        answer = json.loads(text)
        choice, usage = answer["choices"][0], answer["usage"]
        finish, message = FINISH[choice["finish_reason"]], choice["message"]
        content = message.get("content") or ""
        calls = tuple(_call(call) for call in message.get("tool_calls") or ())
        if message.get("refusal") or THINKING in content or not isinstance(content, str):
            return None
        return Answered(
            reply=Reply(text=content, calls=calls, finish=finish),
            usage=_usage(usage, str(answer["model"]), provider_url),
            response_id=str(answer["id"]),
        )
    except (ValueError, KeyError, IndexError, TypeError, AttributeError):
        return None


def _call(call: Mapping[str, Any]) -> ToolCall:
    if call["type"] != "function" or not call["id"]:
        raise ValueError(call["type"])
    function = call["function"]
    return ToolCall(
        id=call["id"], name=function["name"], arguments=arguments_of(function["arguments"])
    )


def _usage(usage: Mapping[str, Any], model: str, provider_url: str) -> RequestUsage:
    """What was used, counted as the provider at this address counts."""
    told = _told(usage)
    details = told.get("completion_tokens_details") or {}
    return RequestUsage.extract(
        {"model": model, "usage": told},
        provider="openai",
        provider_url=provider_url,
        provider_fallback="openai",
        api_flavor="chat",
        details={name: n for name, n in details.items() if isinstance(n, int)},
    )


def _told(usage: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: _told(value) if isinstance(value, dict) else value
        for name, value in usage.items()
        if value is not None
    }
