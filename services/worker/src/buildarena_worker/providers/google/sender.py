"""Sends over Google's protocol."""

from pydantic_ai.models.google import GoogleModel
from pydantic_ai.providers.google import GoogleProvider

from buildarena_backend.catalog.models import ModelEntry, ProviderEntry
from buildarena_worker.providers.library import LibrarySender
from buildarena_worker.providers.limited_http import LimitedClient


def create_sender(entry: ModelEntry, provider: ProviderEntry, key: str) -> LibrarySender:
    """Return the sender of a model."""
    # The retry policy has its own timeout.
    http = LimitedClient(timeout=None, headers=provider.headers)
    google = GoogleProvider(api_key=key, base_url=provider.base_url, http_client=http)
    model = GoogleModel(entry.model, provider=google)
    return LibrarySender(model, http.aclose, entry, takes_parallel_tool_calls=False)
