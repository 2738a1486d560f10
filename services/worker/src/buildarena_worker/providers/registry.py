"""Providers' protocols by name: the folders of this package, and other distributions'.

A protocol's module `sender` has `create_sender`, which creates the sender of a model from its
entry, its provider's entry and the API key ("none" if the provider needs none). A distribution adds
a protocol by an entry point in the group `buildarena.providers`, which names such a module. Modules
are imported when a model needs them.
"""

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
    """Sender of requests to one model, without retries."""

    async def send(self, request: Request) -> Completion:
        """Return the model's answer to a conversation.

        Raises:
            ProviderError: The provider refuses, can't be reached, or returns an unreadable answer.
        """

    async def close(self) -> None:
        """Close the connections."""


@cache
def known_protocols() -> Mapping[str, str]:
    """Return the module of each protocol, by the protocol's name."""
    folders = [part.name for part in pkgutil.iter_modules(providers.__path__) if part.ispkg]
    installed = {point.name: point.value for point in metadata.entry_points(group=GROUP)}
    return MappingProxyType(
        installed | {name: f"{providers.__name__}.{name}.sender" for name in folders}
    )


def require_known_protocols(registry: ModelRegistry) -> None:
    """Check the protocols of the operator's providers.

    Raises:
        StartupError: This worker does not support one of them.
    """
    choices = [BUILTIN_PROTOCOL, *known_protocols()]
    for name, provider in registry.providers.items():
        if provider.protocol not in choices:
            raise StartupError(
                f"provider {name!r}: unknown protocol {provider.protocol!r}; "
                f"valid protocols: {', '.join(choices)}"
            )


def sender_for(entry: ModelEntry, provider: ProviderEntry, key: str) -> Sender:
    """Return the sender for the provider's protocol.

    Raises:
        PermanentError: This worker does not support it.
    """
    module = known_protocols().get(provider.protocol)
    if module is None:
        raise PermanentError(
            f"this worker does not support the protocol {provider.protocol!r}",
            reason="unknown_protocol",
        )
    sender: Sender = import_module(module).create_sender(entry, provider, key)
    return sender
