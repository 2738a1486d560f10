"""One sending of a request to a provider, by wire."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from itertools import cycle
from typing import Any, Protocol

from pydantic_ai.direct import model_request
from pydantic_ai.models import Model
from pydantic_ai.settings import ModelSettings

from buildarena_pipeline.catalog.models import ModelEntry, ProviderEntry
from buildarena_worker.providers.wire import Answered, from_wire, request_parameters, to_wire
from buildarena_worker.session.messages import Message, Tool

POOLS = 16
"""Connection pools per model over httpx: it looks at all connections of a pool for each request,
so that many small pools carry hundreds of open requests at less cost than one large one."""

Connected = tuple[Model, Callable[[], Awaitable[Any]]]
"""A model with connections of its own, and how to close them."""


class Sender(Protocol):
    """Sends requests to one model, each once."""

    async def send(
        self, messages: Sequence[Message], tools: Sequence[Tool], settings: ModelSettings
    ) -> Answered:
        """The model's answer to a conversation.

        Raises:
            ModelAPIError: The provider says no, can't be reached, or answers nonsense.
        """

    async def close(self) -> None:
        """Closes the connections."""


def sender_for(entry: ModelEntry, provider: ProviderEntry, key: str) -> Sender:
    """The sender that speaks the provider's wire."""
    if provider.wire == "openai":
        from buildarena_worker.providers.openai_chat import OpenAIChat

        return OpenAIChat(model=entry.model, base_url=provider.base_url, api_key=key)
    make = _anthropic if provider.wire == "anthropic" else _google
    return LibrarySender([make(entry, provider, key) for _ in range(POOLS)])


class LibrarySender:
    """Sends through pydantic-ai and the provider's SDK.

    Args:
        models: One model several times.
    """

    def __init__(self, models: Sequence[Connected]) -> None:
        self._models = cycle([model for model, _ in models])
        self._closers = [close for _, close in models]

    async def send(
        self, messages: Sequence[Message], tools: Sequence[Tool], settings: ModelSettings
    ) -> Answered:
        """The model's answer to a conversation."""
        response = await model_request(
            next(self._models),
            to_wire(messages),
            model_settings=settings,
            model_request_parameters=request_parameters(tools),
        )
        return from_wire(response)

    async def close(self) -> None:
        """Closes the connections."""
        for close in self._closers:
            await close()


def _anthropic(entry: ModelEntry, provider: ProviderEntry, key: str) -> Connected:
    from anthropic import AsyncAnthropic
    from pydantic_ai.models.anthropic import AnthropicModel
    from pydantic_ai.providers.anthropic import AnthropicProvider

    client = AsyncAnthropic(base_url=provider.base_url, api_key=key, max_retries=0)
    model = AnthropicModel(entry.model, provider=AnthropicProvider(anthropic_client=client))
    return model, client.close


def _google(entry: ModelEntry, provider: ProviderEntry, key: str) -> Connected:
    from httpx2 import AsyncClient
    from pydantic_ai.models.google import GoogleModel
    from pydantic_ai.providers.google import GoogleProvider

    http = AsyncClient(timeout=None)  # the retry policy's own timeout rules
    google = GoogleProvider(api_key=key, base_url=provider.base_url, http_client=http)
    return GoogleModel(entry.model, provider=google), http.aclose
