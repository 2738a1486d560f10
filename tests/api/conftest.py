from collections.abc import Iterator

import pytest
from starlette.testclient import TestClient
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import api_client, changed

from buildarena_pipeline.runtime.context import Context


@pytest.fixture
def api(context: Context) -> Iterator[TestClient]:
    """The API in this process, on the real database and broker."""
    with api_client(context, raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def guarded(context: Context) -> Iterator[TestClient]:
    """The API with keys asked for; requests carry none by themselves."""
    with (
        changed(context, **WITH_KEYS) as own,
        api_client(own, raise_server_exceptions=False) as client,
    ):
        yield client


@pytest.fixture
def sweep() -> dict[str, object]:
    return {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0, 1]}
