from __future__ import annotations

from collections.abc import Iterator

import pytest
from starlette.testclient import TestClient
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import LOOPBACK

from buildarena_api.app import create_app
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.runtime.context import Context, open_context


@pytest.fixture
def api(context: Context) -> Iterator[TestClient]:
    """The API in this process, on the real database and broker."""
    with TestClient(
        create_app(context, load_registry()), base_url=LOOPBACK, raise_server_exceptions=False
    ) as client:
        yield client


@pytest.fixture
def guarded(context: Context) -> Iterator[TestClient]:
    """The API with keys asked for; requests carry none by themselves."""
    own = open_context(context.settings.model_copy(update=WITH_KEYS))
    with TestClient(
        create_app(own, load_registry()), base_url=LOOPBACK, raise_server_exceptions=False
    ) as client:
        yield client
    own.close()


@pytest.fixture
def sweep() -> dict[str, object]:
    return {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0, 1]}
