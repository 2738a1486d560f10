from collections.abc import Iterator

import pytest
from support.servers.live_api import live_api

from buildarena_backend.process.context import Context


@pytest.fixture
def url(context: Context) -> Iterator[str]:
    """A service over real HTTP."""
    with live_api(context) as found:
        yield found
