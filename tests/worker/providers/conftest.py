"""Clients of provider stand-ins."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from support.providers.stand_in import ProviderStandIn

from buildarena_backend.catalog.models import ModelEntry, Price, ProviderEntry
from buildarena_worker.providers.provider import ProviderClient, RetryPolicy

QUICK = RetryPolicy(attempts=5, first_wait_s=0.01, longest_wait_s=0.05, timeout_s=2.0)
PRICE = Price(input=2.0, output=8.0, cached=0.5)


@pytest.fixture
def client(monkeypatch) -> Iterator[Callable[..., ProviderClient]]:
    """Makes clients of a stand-in and closes them."""
    monkeypatch.setenv("STANDIN_KEY", "secret")
    made: list[ProviderClient] = []

    def make(
        standin: ProviderStandIn,
        protocol: str = "openai",
        policy: RetryPolicy | None = QUICK,
        *,
        model: dict[str, Any] | None = None,
        **provider: Any,
    ) -> ProviderClient:
        base = f"{standin.url}/v1" if protocol == "openai" else standin.url
        name = f"{protocol}/standin"
        more = model or {}
        entry = ModelEntry(name=name, provider=protocol, model="standin", price=PRICE, **more)
        reached = ProviderEntry(protocol=protocol, base_url=base, key="STANDIN_KEY", **provider)
        made.append(ProviderClient(entry, reached, policy))
        return made[-1]

    yield make
    for one in made:
        one.close()
