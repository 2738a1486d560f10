"""Protocols that use pydantic-ai and the providers' own libraries."""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, cast

from pydantic_ai import exceptions
from pydantic_ai import messages as library
from pydantic_ai.direct import model_request
from pydantic_ai.models import Model, ModelRequestParameters
from pydantic_ai.settings import ModelSettings
from pydantic_ai.tools import ToolDefinition as LibraryTool

from buildarena_backend.catalog.models import ModelEntry
from buildarena_geometry import ToolDefinition
from buildarena_worker.providers.failures import RETRIED_STATUS, Failure, ProviderError
from buildarena_worker.providers.limited_http import RECEIVED, Received
from buildarena_worker.providers.response_limits import MAX_CALLS, arguments_of, bounded, usage_of
from buildarena_worker.session.messages import Completion, Message, Request, ToolCall

DECODING = ("temperature", "top_p", "max_tokens")
FINISH = {"tool_call": "stop", None: "stop"}
FAILURES: tuple[tuple[type[Exception], Failure], ...] = (
    (exceptions.ModelContextWindowExceededError, Failure.CONTEXT_OVERFLOW),
    (exceptions.ContentFilterError, Failure.CONTENT_FILTER),
    (exceptions.ModelAuthenticationError, Failure.BAD_CREDENTIALS),
    (exceptions.ModelNotFoundError, Failure.MODEL_NOT_FOUND),
    (exceptions.ModelQuotaExceededError, Failure.QUOTA_EXCEEDED),
)


@dataclass(frozen=True, slots=True)
class LibrarySender:
    """Sender that uses pydantic-ai and the provider's library.

    Attributes:
        model: The model, as pydantic-ai has it.
        close: Closes its connections.
        entry: The operator's entry for the model.
        takes_parallel_tool_calls: Whether parallel tool calls can be turned off.
    """

    model: Model
    close: Callable[[], Awaitable[Any]]
    entry: ModelEntry
    takes_parallel_tool_calls: bool

    async def send(self, request: Request) -> Completion:
        """Return the model's answer to a conversation.

        Raises:
            ProviderError: The provider refuses, can't be reached, or returns an unreadable answer.
        """
        received = Received()
        RECEIVED.set(received)
        try:
            response = await model_request(
                self.model,
                to_library(request.messages),
                model_settings=self._settings(request),
                model_request_parameters=request_parameters(request.tools),
            )
            return from_library(response)
        except Exception as error:
            received.require_usable()
            raise _convert_error(error, received) from error

    def _settings(self, request: Request) -> ModelSettings:
        decoding = request.model_config["decoding"]
        if self.entry.max_tokens is not None:
            decoding = {"max_tokens": self.entry.max_tokens, **decoding}
        chosen = {name: decoding[name] for name in DECODING if name in decoding}
        settings = cast("ModelSettings", {"seed": request.seed, **chosen})
        if self.entry.extra_body:
            settings["extra_body"] = dict(self.entry.extra_body)
        if request.tools and self.takes_parallel_tool_calls:
            settings["parallel_tool_calls"] = False
        return settings


def _convert_error(error: Exception, received: Received) -> ProviderError:
    """Convert a library's error; if there was an answer, it could not be read."""
    about = f"{type(error).__name__}: {error}"
    named = [failure for kind, failure in FAILURES if isinstance(error, kind)]
    if received.succeeded and not named:
        text = f"the answer can't be read: {about}"
        return ProviderError(text, Failure.GARBAGE, usage=received.usage())
    http = error if isinstance(error, exceptions.ModelHTTPError) else None
    refused = http is not None and http.status_code not in RETRIED_STATUS
    failure = (*named, Failure.REQUEST_REFUSED if refused else Failure.OUTAGE)[0]
    busy = isinstance(error, (exceptions.ModelRateLimitError, exceptions.ModelOverloadedError))
    return ProviderError(about, failure, overloaded=busy, headers=getattr(http, "headers", None))


def to_library(messages: Sequence[Message]) -> list[library.ModelMessage]:
    """Convert a conversation to pydantic-ai's form; adjacent messages of one side become one."""
    sides = groupby(messages, key=lambda message: message.role == "assistant")
    written: list[library.ModelMessage] = []
    for own, group in sides:
        if own:
            written += [library.ModelResponse(parts=_response_parts(message)) for message in group]
        else:
            written.append(library.ModelRequest(parts=[*map(_request_part, group)]))
    return written


def _request_part(message: Message) -> library.ModelRequestPart:
    if message.role == "system":
        return library.SystemPromptPart(content=message.text)
    if message.role == "tool":
        return library.ToolReturnPart(
            tool_name=message.tool or "",
            content=message.text,
            tool_call_id=message.call_id or "",
        )
    return library.UserPromptPart(content=message.text)


def _response_parts(message: Message) -> list[library.ModelResponsePart]:
    text = [library.TextPart(content=message.text)] if message.text else []
    calls = [
        library.ToolCallPart(tool_name=call.name, args=call.arguments_json, tool_call_id=call.id)
        for call in message.calls
    ]
    return [*text, *calls]


def request_parameters(tools: Sequence[ToolDefinition]) -> ModelRequestParameters:
    """Convert tools to pydantic-ai's form."""
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


def from_library(response: library.ModelResponse) -> Completion:
    """Convert an answer to a completion."""
    text = "".join(part.content for part in response.parts if isinstance(part, library.TextPart))
    calls = tuple(
        ToolCall(id=part.tool_call_id, name=part.tool_name, arguments=arguments_of(part.args))
        for part in response.parts
        if isinstance(part, library.ToolCallPart)
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
