"""Between our neutral messages and pydantic-ai's, which speak the providers' wire formats."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pydantic_ai.messages import (
    ModelMessage,
    ModelRequest,
    ModelRequestPart,
    ModelResponse,
    ModelResponsePart,
    SystemPromptPart,
    TextPart,
    ToolCallPart,
    ToolReturnPart,
    UserPromptPart,
)
from pydantic_ai.models import ModelRequestParameters
from pydantic_ai.tools import ToolDefinition
from pydantic_ai.usage import RequestUsage

from buildarena_worker.session.messages import Message, Reply, Tool, ToolCall

FINISH = {"tool_call": "stop", None: "stop"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Answered:
    """An answer of a provider.

    Attributes:
        reply: What the model said.
        usage: What it used, as the provider counts.
        response_id: The provider's own id of the answer, if it gave one.
    """

    reply: Reply
    usage: RequestUsage
    response_id: str | None


def to_wire(messages: Sequence[Message]) -> list[ModelMessage]:
    """The conversation in pydantic-ai's form; adjacent messages of one side become one."""
    wire: list[ModelMessage] = []
    requests: list[ModelRequestPart] = []
    for message in messages:
        if message.role == "assistant":
            if requests:
                wire.append(ModelRequest(parts=requests))
                requests = []
            wire.append(ModelResponse(parts=_response_parts(message)))
        else:
            requests.append(_request_part(message))
    if requests:
        wire.append(ModelRequest(parts=requests))
    return wire


def _request_part(message: Message) -> ModelRequestPart:
    if message.role == "system":
        return SystemPromptPart(content=message.text)
    if message.role == "tool":
        return ToolReturnPart(
            tool_name=message.tool or "",
            content=message.text,
            tool_call_id=message.call_id or "",
        )
    return UserPromptPart(content=message.text)


def _response_parts(message: Message) -> list[ModelResponsePart]:
    parts: list[ModelResponsePart] = []
    if message.text:
        parts.append(TextPart(content=message.text))
    parts += [
        ToolCallPart(tool_name=call.name, args=arguments_text(call), tool_call_id=call.id)
        for call in message.calls
    ]
    return parts


def request_parameters(tools: Sequence[Tool]) -> ModelRequestParameters:
    """The tools in pydantic-ai's form."""
    return ModelRequestParameters(
        function_tools=[
            ToolDefinition(
                name=tool.name,
                description=tool.description,
                parameters_json_schema=dict(tool.parameters),
            )
            for tool in tools
        ],
        allow_text_output=True,
    )


def from_wire(response: ModelResponse) -> Answered:
    """An answer in our form."""
    text = "".join(part.content for part in response.parts if isinstance(part, TextPart))
    calls = tuple(
        ToolCall(id=part.tool_call_id, name=part.tool_name, arguments=arguments_of(part.args))
        for part in response.parts
        if isinstance(part, ToolCallPart)
    )
    finish = response.finish_reason
    return Answered(
        reply=Reply(text=text, calls=calls, finish=FINISH.get(finish, finish or "stop")),
        usage=response.usage,
        response_id=response.provider_response_id,
    )


def arguments_text(call: ToolCall) -> str:
    """A call's arguments as JSON: an object, even when the model gave something else.

    Providers accept nothing else in a conversation.
    """
    arguments = call.arguments if isinstance(call.arguments, dict) else {"text": call.arguments}
    return json.dumps(arguments, ensure_ascii=False, separators=(",", ":"))


def arguments_of(raw: Any) -> Any:
    """What a model gave as a call's arguments: an object, or text that is no JSON."""
    if not isinstance(raw, str):
        return {} if raw is None else raw
    try:
        return json.loads(raw) if raw.strip() else {}
    except ValueError:
        return raw
