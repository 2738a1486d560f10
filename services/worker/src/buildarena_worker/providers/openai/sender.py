"""Sends over OpenAI's protocol."""

from __future__ import annotations

from buildarena_backend.catalog.models import ModelEntry, ProviderEntry
from buildarena_worker.providers.openai.chat import OpenAIChat


def create_sender(entry: ModelEntry, provider: ProviderEntry, key: str) -> OpenAIChat:
    """The sender of a model."""
    return OpenAIChat(model=entry.model, base_url=provider.base_url, api_key=key)
