"""The whole OpenAPI contract under generated requests: no 5xx, no undocumented answer."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings, strategies
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from support.clients.tenants import ADMIN, WITH_KEYS
from support.long_tests import LONG
from support.servers.live_api import live_api

from buildarena_pipeline.catalog.specs import SweepSpec

CONTRACT = Path(__file__).parents[1] / "data" / "openapi.json"
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]
FRAMING = {"content-length", "transfer-encoding", "connection", "expect"}
"""A request that announces what it does not send has no end, and no answer."""
schemathesis.serializer.alias(["application/zip"], "application/octet-stream")
schemathesis.openapi.media_type("application/zip", strategies.binary(max_size=100))
# Streams have no end; test_operating.py reads them.
SCHEMA = schemathesis.openapi.from_path(CONTRACT).exclude(path_regex="/events$")
OPERATIONS = {found.ok().label: found.ok() for found in SCHEMA.get_all_operations()}


@pytest.fixture
def service(context, submissions) -> Iterator[str]:
    """A live service that holds a few jobs and counts no requests."""
    submissions.submit_sweep(SweepSpec(tasks=["lift-1"], models=["builtin/idle"], seeds=[0, 1]))
    settings = context.settings.model_copy(update={**WITH_KEYS, "require_keys": False})
    with live_api(replace(context, settings=settings)) as url:
        yield url


# What takes no input can't be asked wrongly.
WAYS = [
    (label, mode)
    for label, operation in OPERATIONS.items()
    for mode in GenerationMode
    if mode is GenerationMode.POSITIVE or operation.body or list(operation.iter_parameters())
]


@pytest.mark.sized
@pytest.mark.parametrize(("label", "mode"), WAYS)
def test_every_answer_is_a_documented_one(service, label, mode) -> None:
    @settings(
        max_examples=12 if LONG else 5,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(case=OPERATIONS[label].as_strategy(generation_mode=mode))
    def ask(case) -> None:
        for name in [name for name in case.headers or {} if name.lower() in FRAMING]:
            del case.headers[name]
        headers = {"Authorization": f"Bearer {ADMIN}"}
        case.call_and_validate(base_url=service, headers=headers, checks=CHECKS, timeout=30)

    ask()
