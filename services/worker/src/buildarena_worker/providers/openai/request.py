"""Requests in OpenAI's chat completions: our messages, tools and settings as its JSON.

Written from OpenAI's API reference. Bodies are compared with kept ones in
``tests/worker/providers/test_openai.py``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from pydantic_ai.profiles.openai import OpenAIJsonSchemaTransformer

from buildarena_backend.catalog.models import ModelEntry
from buildarena_worker.session.messages import Message, Request


def request_body(entry: ModelEntry, request: Request) -> bytes:
    """The body of a request to a model."""
    messages = json.dumps(write_messages(request.messages), ensure_ascii=False)
    tools = [[tool.name, tool.description, tool.parameters] for tool in request.tools]
    decoding = request.model_config["decoding"]
    if entry.max_tokens is not None:
        decoding = {"max_tokens": entry.max_tokens, **decoding}
    given = json.dumps([tools, decoding, entry.extra_body])
    rest = _rest(entry.model, given, sampling=entry.sampling)
    return f'{{"messages":{messages},"seed":{request.seed},{rest}'.encode()


@lru_cache(maxsize=256)
def _rest(model: str, given: str, *, sampling: bool) -> str:
    """All but messages and seed, which is the same for all requests of a role.

    Args:
        model: The provider's name of the model.
        given: Tools, decoding and further fields, as JSON.
        sampling: Whether the model takes temperature and top_p.
    """
    tools, decoding, further = json.loads(given)
    rest: dict[str, Any] = {"model": model}
    if tools:
        rest["parallel_tool_calls"] = False
        rest["tools"] = [function_tool(*tool) for tool in tools]
        rest["tool_choice"] = "auto"
    rest["stream"] = False
    if "max_tokens" in decoding:
        rest["max_completion_tokens"] = decoding["max_tokens"]
    if sampling:
        rest |= {name: decoding[name] for name in ("temperature", "top_p") if name in decoding}
    return json.dumps(further | rest, ensure_ascii=False)[1:]


def function_tool(name: str, description: str, parameters: dict[str, Any]) -> dict[str, Any]:
    """A tool as a function of the wire's ``tools``.

    One whose schema fits OpenAI's strict mode is sent in it: the model then can't give arguments
    of another form.
    """
    schema = OpenAIJsonSchemaTransformer(parameters)
    function = {"name": name, "description": description, "parameters": schema.walk()}
    strict = {"strict": True} if schema.is_strict_compatible else {}
    return {"type": "function", "function": function | strict}


def write_messages(messages: Sequence[Message]) -> list[dict[str, Any]]:
    """The conversation as the wire's ``messages``; one that says nothing is not allowed there."""
    return [_message(message) for message in messages if message.text or message.calls]


def _message(message: Message) -> dict[str, Any]:
    if message.role == "tool":
        return {"role": "tool", "tool_call_id": message.call_id or "", "content": message.text}
    if message.role != "assistant":
        return {"role": message.role, "content": message.text}
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
