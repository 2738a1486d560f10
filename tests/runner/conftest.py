from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import live_api

from buildarena_pipeline.runtime.context import Context, open_context
from buildarena_pipeline.runtime.settings import Settings


@pytest.fixture
def lease_s() -> float:
    """Longer than any machine takes between two heartbeats of a test."""
    return 60.0


@pytest.fixture
def settings(settings: Settings, lease_s: float) -> Settings:
    return settings.model_copy(update={"lease_s": lease_s})


@pytest.fixture
def url(context: Context) -> Iterator[str]:
    """An API that asks for keys."""
    own = open_context(context.settings.model_copy(update=WITH_KEYS))
    with live_api(own) as found:
        yield found
    own.close()
