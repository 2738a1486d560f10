"""Between our neutral messages and pydantic-ai's, which speak the providers' wire formats."""

from __future__ import annotations

import json
from collections.abc import Sequence
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

from buildarena_worker.messages import Message, Reply, Tool, ToolCall

FINISH = {"tool_call": "stop", None: "stop"}


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
    for call in message.calls:
        # A provider accepts only an object here, even when the model gave something else.
        arguments = call.arguments if isinstance(call.arguments, dict) else {"text": call.arguments}
        parts.append(
            ToolCallPart(
                tool_name=call.name,
                args=json.dumps(arguments, ensure_ascii=False),
                tool_call_id=call.id,
            )
        )
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


def from_wire(response: ModelResponse) -> Reply:
    """A reply in our form."""
    text = "".join(part.content for part in response.parts if isinstance(part, TextPart))
    calls = tuple(
        ToolCall(id=part.tool_call_id, name=part.tool_name, arguments=_arguments(part.args))
        for part in response.parts
        if isinstance(part, ToolCallPart)
    )
    finish = response.finish_reason
    return Reply(text=text, calls=calls, finish=FINISH.get(finish, finish or "stop"))


def _arguments(raw: Any) -> Any:
    if not isinstance(raw, str):
        return {} if raw is None else raw
    try:
        return json.loads(raw) if raw.strip() else {}
    except ValueError:
        return raw
