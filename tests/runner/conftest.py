from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import live_api

from buildarena_pipeline.runtime.context import Context, open_context

LEASE_S = 8.0


@pytest.fixture
def url(context: Context) -> Iterator[str]:
    """An API that asks for keys, and waits for late heartbeats longer than tests usually do."""
    own = open_context(context.settings.model_copy(update={**WITH_KEYS, "lease_s": LEASE_S}))
    with live_api(own) as found:
        yield found
    own.close()
