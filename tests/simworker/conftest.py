from collections.abc import Iterator

import pytest
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import live_api
from support.servers.runner_rig import Caller, runner_key

from buildarena_backend.process.context import Context
from buildarena_backend.settings import Settings


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
    with live_api(context, **WITH_KEYS) as found:
        yield found


@pytest.fixture
def caller(context: Context, url: str) -> Caller:
    """A runner with a key of its own."""
    return Caller(url, runner_key(context)[1])
