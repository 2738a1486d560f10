"""The whole OpenAPI contract under generated requests: no 5xx, no undocumented answer."""

from collections.abc import Iterator
from dataclasses import replace

import pytest
import schemathesis
from hypothesis import strategies
from support.clients.tenants import ADMIN, WITH_KEYS
from support.servers.contract import SCHEMA, ask, ways
from support.servers.live_api import live_api

from buildarena_pipeline.catalog.specs import SweepSpec

pytestmark = pytest.mark.ci

FRAMING = {"content-length", "transfer-encoding", "connection", "expect"}
"""A request that announces what it does not send has no end, and no answer."""
schemathesis.serializer.alias(["application/zip"], "application/octet-stream")
schemathesis.openapi.media_type("application/zip", strategies.binary(max_size=100))
# Streams have no end; test_operating.py reads them.
WAYS = ways(SCHEMA.exclude(path_regex="/events$"))


@pytest.fixture
def service(context, submissions) -> Iterator[str]:
    """A live service that holds a few jobs and counts no requests."""
    submissions.submit_sweep(SweepSpec(tasks=["lift-1"], models=["builtin/idle"], seeds=[0, 1]))
    settings = context.settings.model_copy(update={**WITH_KEYS, "require_keys": False})
    with live_api(replace(context, settings=settings)) as url:
        yield url


@pytest.mark.nightly(keep=3)
@pytest.mark.parametrize("way", WAYS, ids=lambda way: f"{way[0].label}-{way[1].value}")
def test_every_answer_is_a_documented_one(service, way) -> None:
    def prepare(case) -> None:
        for name in [name for name in case.headers or {} if name.lower() in FRAMING]:
            del case.headers[name]

    ask(service, way, 5, prepare, Authorization=f"Bearer {ADMIN}")
