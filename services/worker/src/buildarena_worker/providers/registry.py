"""The protocols of providers by name: each folder here, and other distributions'.

A protocol's module `sender` has `create_sender`, which makes the sender of a model from its entry,
its provider's and the API key, "none" where the provider needs none. A distribution adds a protocol
by an entry point in the group `buildarena.providers`, which names such a module. Each is imported
when a model needs it.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from functools import cache
from importlib import import_module, metadata
from types import MappingProxyType
from typing import Final, Protocol

from buildarena_backend.catalog.models import (
    BUILTIN_PROTOCOL,
    ModelEntry,
    ModelRegistry,
    ProviderEntry,
)
from buildarena_backend.errors import PermanentError, StartupError
from buildarena_worker import providers
from buildarena_worker.session.messages import Completion, Request

GROUP: Final = "buildarena.providers"


class Sender(Protocol):
    """Sends requests to one model, each once."""

    async def send(self, request: Request) -> Completion:
        """Return the model's answer to a conversation.

        Raises:
            ProviderError: The provider says no, can't be reached, or answers nonsense.
        """

    async def close(self) -> None:
        """Close the connections."""


@cache
def known_protocols() -> Mapping[str, str]:
    """Return the module of each protocol, by the protocol's name."""
    folders = [part.name for part in pkgutil.iter_modules(providers.__path__) if part.ispkg]
    others = {point.name: point.value for point in metadata.entry_points(group=GROUP)}
    return MappingProxyType(
        others | {name: f"{providers.__name__}.{name}.sender" for name in folders}
    )


def require_known_protocols(registry: ModelRegistry) -> None:
    """Check the operator's providers before any of their models is asked.

    Raises:
        StartupError: One speaks a protocol that this worker does not.
    """
    choices = [BUILTIN_PROTOCOL, *known_protocols()]
    for name, provider in registry.providers.items():
        if provider.protocol not in choices:
            raise StartupError(
                f"provider {name!r}: there is no protocol {provider.protocol!r}; "
                f"there are {', '.join(choices)}"
            )


def sender_for(entry: ModelEntry, provider: ProviderEntry, key: str) -> Sender:
    """Return the sender that speaks the provider's protocol.

    Raises:
        PermanentError: This worker does not speak it.
    """
    module = known_protocols().get(provider.protocol)
    if module is None:
        raise PermanentError(
            f"this worker does not speak the protocol {provider.protocol!r}",
            reason="unknown_protocol",
        )
    sender: Sender = import_module(module).create_sender(entry, provider, key)
    return sender
