"""Protocols that are spoken through pydantic-ai and the providers' own libraries."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from pydantic_ai.direct import model_request
from pydantic_ai.exceptions import (
    ContentFilterError,
    ModelAuthenticationError,
    ModelContextWindowExceededError,
    ModelHTTPError,
    ModelNotFoundError,
    ModelOverloadedError,
    ModelQuotaExceededError,
    ModelRateLimitError,
)
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
from pydantic_ai.models import Model, ModelRequestParameters
from pydantic_ai.settings import ModelSettings
from pydantic_ai.tools import ToolDefinition as LibraryTool

from buildarena_geometry import ToolDefinition
from buildarena_worker.providers.bounded_http import RECEIVED, Received
from buildarena_worker.providers.bounds import MAX_CALLS, arguments_of, bounded, usage_of
from buildarena_worker.providers.failures import RETRIED_STATUS, Failure, ProviderError
from buildarena_worker.session.messages import Completion, Message, Request, ToolCall

POOLS = 16
"""Connection pools per model over httpx at most: it looks at all connections of a pool for each
request, so that many small pools carry hundreds of open requests at less cost than one large one.
"""
SMALL_POOL = 8
"""Open requests of each pool from which another one is worth the 0.1 s that it takes to make."""
FINISH = {"tool_call": "stop", None: "stop"}
FAILURES: tuple[tuple[type[Exception], Failure], ...] = (
    (ModelContextWindowExceededError, Failure.CONTEXT_OVERFLOW),
    (ContentFilterError, Failure.CONTENT_FILTER),
    (ModelAuthenticationError, Failure.BAD_CREDENTIALS),
    (ModelNotFoundError, Failure.MODEL_NOT_FOUND),
    (ModelQuotaExceededError, Failure.QUOTA_EXCEEDED),
)

Connected = tuple[Model, Callable[[], Awaitable[Any]]]
"""A model with connections of its own, and how to close them."""


@dataclass(slots=True)
class _Pool:
    """A model with connections of its own, and the requests that are open on them."""

    connected: Connected
    open: int = 0


class LibrarySender:
    """Sends through pydantic-ai and the provider's library.

    Args:
        connect: Makes the model, each time with connections of its own.
        takes_parallel_tool_calls: Whether the provider lets parallel tool calls be turned off.
    """

    def __init__(
        self, connect: Callable[[], Connected], *, takes_parallel_tool_calls: bool
    ) -> None:
        self._connect = connect
        self._pools = [_Pool(connect())]
        self._takes_parallel_tool_calls = takes_parallel_tool_calls

    async def send(self, request: Request) -> Completion:
        """The model's answer to a conversation.

        Raises:
            ProviderError: The provider says no, can't be reached, or answers nonsense.
        """
        received = Received()
        RECEIVED.set(received)
        try:
            with self._model() as model:
                response = await model_request(
                    model,
                    to_library(request.messages),
                    model_settings=self._settings(request),
                    model_request_parameters=request_parameters(request.tools),
                )
            return from_library(response)
        except Exception as error:
            received.require_usable()
            raise _translated(error, received) from error

    async def close(self) -> None:
        """Closes the connections."""
        for pool in self._pools:
            _, close = pool.connected
            await close()

    @contextmanager
    def _model(self) -> Iterator[Model]:
        """The model with the fewest open requests."""
        pool = min(self._pools, key=lambda pool: pool.open)
        if pool.open >= SMALL_POOL and len(self._pools) < POOLS:
            pool = _Pool(self._connect())
            self._pools.append(pool)
        pool.open += 1
        try:
            yield pool.connected[0]
        finally:
            pool.open -= 1

    def _settings(self, request: Request) -> ModelSettings:
        decoding = request.model_config["decoding"]
        settings = ModelSettings(seed=request.seed)
        if "temperature" in decoding:
            settings["temperature"] = decoding["temperature"]
        if "top_p" in decoding:
            settings["top_p"] = decoding["top_p"]
        if "max_tokens" in decoding:
            settings["max_tokens"] = decoding["max_tokens"]
        if request.tools and self._takes_parallel_tool_calls:
            settings["parallel_tool_calls"] = False
        return settings


def _translated(error: Exception, received: Received) -> ProviderError:
    """A library's error in our words; where there was an answer, it could not be read."""
    if received.succeeded and not isinstance(error, tuple(kind for kind, _ in FAILURES)):
        return ProviderError(
            f"the answer can't be read: {type(error).__name__}: {error}",
            Failure.GARBAGE,
            usage=received.usage(),
        )
    status = error.status_code if isinstance(error, ModelHTTPError) else None
    named = [failure for kind, failure in FAILURES if isinstance(error, kind)]
    refused = status is not None and status not in RETRIED_STATUS
    failure = (*named, Failure.REQUEST_REFUSED if refused else Failure.OUTAGE)[0]
    return ProviderError(
        f"{type(error).__name__}: {error}",
        failure,
        overloaded=isinstance(error, (ModelRateLimitError, ModelOverloadedError)),
        headers=error.headers if isinstance(error, ModelHTTPError) else None,
    )


def to_library(messages: Sequence[Message]) -> list[ModelMessage]:
    """The conversation in pydantic-ai's form; adjacent messages of one side become one."""
    messages_: list[ModelMessage] = []
    requests: list[ModelRequestPart] = []
    for message in messages:
        if message.role == "assistant":
            if requests:
                messages_.append(ModelRequest(parts=requests))
                requests = []
            messages_.append(ModelResponse(parts=_response_parts(message)))
        else:
            requests.append(_request_part(message))
    if requests:
        messages_.append(ModelRequest(parts=requests))
    return messages_


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
        ToolCallPart(tool_name=call.name, args=call.arguments_json, tool_call_id=call.id)
        for call in message.calls
    ]
    return parts


def request_parameters(tools: Sequence[ToolDefinition]) -> ModelRequestParameters:
    """The tools in pydantic-ai's form."""
    return ModelRequestParameters(
        function_tools=[
            LibraryTool(
                name=tool.name,
                description=tool.description,
                parameters_json_schema=dict(tool.parameters),
            )
            for tool in tools
        ],
        allow_text_output=True,
    )


def from_library(response: ModelResponse) -> Completion:
    """An answer in our form."""
    text = "".join(part.content for part in response.parts if isinstance(part, TextPart))
    calls = tuple(
        ToolCall(id=part.tool_call_id, name=part.tool_name, arguments=arguments_of(part.args))
        for part in response.parts
        if isinstance(part, ToolCallPart)
    )[:MAX_CALLS]
    finish, used = response.finish_reason, response.usage
    return bounded(
        Completion(
            text=text,
            calls=calls,
            finish=FINISH.get(finish, finish or "stop"),
            usage=usage_of(
                used.input_tokens,
                used.output_tokens,
                used.cache_read_tokens,
                used.details.get("reasoning_tokens") if used.details else 0,
            ),
            provider_request_id=response.provider_response_id,
        )
    )
