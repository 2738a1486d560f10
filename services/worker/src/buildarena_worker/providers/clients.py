"""Clients by model: built-in models run in the process, all others are reached over HTTP."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from buildarena_backend.catalog.models import (
    BUILTIN_PROTOCOL,
    ModelEntry,
    ModelRegistry,
    ProviderEntry,
)
from buildarena_backend.errors import PermanentError
from buildarena_worker.builtin import BuiltinClient
from buildarena_worker.session.messages import ModelClient


class ModelClients:
    """Cache of one client per model, safe to use from many threads.

    Args:
        throttle_url: URL of the store of the providers' shared limits; None for no limits.
    """

    def __init__(self, registry: ModelRegistry, throttle_url: str | None = None) -> None:
        self._registry = registry
        self._throttle_url = throttle_url
        self._clients: dict[str, tuple[ModelEntry, ProviderEntry, ModelClient]] = {}
        self._lock = threading.Lock()

    def for_config(self, model_config: Mapping[str, Any]) -> ModelClient:
        """Return the client for a job's model.

        Raises:
            PermanentError: The operator's registry lacks the model, or its key is not set.
        """
        name = str(model_config["name"])
        entry = self._registry.models.get(name)
        if entry is None:
            raise PermanentError(
                f"this worker's model registry lacks {name!r}", reason="unknown_model"
            )
        provider = self._registry.provider_of(entry)
        with self._lock:
            known = self._clients.get(name)
            if known is None or known[:2] != (entry, provider):
                # Sessions that began with another entry keep their client.
                known = self._clients[name] = entry, provider, self._make(entry, provider)
            return known[2]

    def _make(self, entry: ModelEntry, provider: ProviderEntry) -> ModelClient:
        if provider.protocol == BUILTIN_PROTOCOL:
            return BuiltinClient(entry.model)
        from buildarena_worker.providers.provider import ProviderClient
        from buildarena_worker.providers.throttle import Throttle

        throttle = Throttle(self._throttle_url, entry.provider, maximum=provider.concurrency)
        return ProviderClient(entry, provider, throttle=throttle)
