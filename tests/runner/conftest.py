from collections.abc import Iterator

import pytest
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import changed, live_api

from buildarena_pipeline.runtime.context import Context

LEASE_S = 8.0


@pytest.fixture
def url(context: Context) -> Iterator[str]:
    """An API that asks for keys, and waits for late heartbeats longer than tests usually do."""
    with changed(context, **WITH_KEYS, lease_s=LEASE_S) as own, live_api(own) as found:
        yield found
