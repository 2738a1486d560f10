"""Sends over Anthropic's protocol."""

from anthropic import AsyncAnthropic
from pydantic_ai.models.anthropic import AnthropicModel
from pydantic_ai.providers.anthropic import AnthropicProvider

from buildarena_backend.catalog.models import ModelEntry, ProviderEntry
from buildarena_worker.providers.library import LibrarySender
from buildarena_worker.providers.limited_http import LimitedClient


def create_sender(entry: ModelEntry, provider: ProviderEntry, key: str) -> LibrarySender:
    """Return the sender of a model."""
    client = AsyncAnthropic(
        base_url=provider.base_url,
        api_key=key,
        max_retries=0,
        # The retry policy has its own timeout.
        http_client=LimitedClient(timeout=None, headers=provider.headers),
        timeout=None,
    )
    model = AnthropicModel(entry.model, provider=AnthropicProvider(anthropic_client=client))
    return LibrarySender(model, client.close, entry, takes_parallel_tool_calls=True)
