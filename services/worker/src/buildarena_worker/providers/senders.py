"""One sending of a request to a provider, by wire."""

from __future__ import annotations

from typing import Protocol

from buildarena_pipeline.catalog.models import ModelEntry, ProviderEntry
from buildarena_worker.providers.answered import Answered
from buildarena_worker.session.messages import Request


class Sender(Protocol):
    """Sends requests to one model, each once."""

    async def send(self, request: Request) -> Answered:
        """The model's answer to a conversation.

        Raises:
            ProviderError: The provider says no, can't be reached, or answers nonsense.
        """

    async def close(self) -> None:
        """Closes the connections."""


def sender_for(entry: ModelEntry, provider: ProviderEntry, key: str) -> Sender:
    """The sender that speaks the provider's wire."""
    if provider.wire == "openai":
        from buildarena_worker.providers.openai.chat import OpenAIChat

        return OpenAIChat(model=entry.model, base_url=provider.base_url, api_key=key)
    from buildarena_worker.providers.library import anthropic_sender, google_sender

    make = anthropic_sender if provider.wire == "anthropic" else google_sender
    return make(entry, provider, key)
