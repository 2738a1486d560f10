"""The runner protocol's part of the contract under generated requests of one who may."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from live_api import live_api
from runner_rig import Caller, waiting
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from tenants import WITH_KEYS

CONTRACT = Path(__file__).parents[1] / "data" / "openapi.json"
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]
SCHEMA = schemathesis.openapi.from_path(CONTRACT).include(path_regex="^/v1/runner")
OPERATIONS = {found.ok().label: found.ok() for found in SCHEMA.get_all_operations()}
WAYS = [
    (label, mode)
    for label, operation in OPERATIONS.items()
    for mode in GenerationMode
    if mode is GenerationMode.POSITIVE or operation.body or list(operation.iter_parameters())
]


@pytest.fixture
def lease(context) -> Iterator[dict[str, object]]:
    """A live lease of the operator's, with the API's address under ``url``."""
    waiting(context)
    own = context.settings.model_copy(update={**WITH_KEYS, "require_keys": False, "lease_s": 60.0})
    with live_api(replace(context, settings=own)) as url:
        yield {"url": url, **Caller(url).lease()}


@pytest.mark.parametrize(("label", "mode"), WAYS)
def test_every_answer_is_a_documented_one(lease, label, mode) -> None:
    @settings(
        max_examples=3,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(case=OPERATIONS[label].as_strategy(generation_mode=mode))
    def ask(case) -> None:
        # Half of what is worth asking needs a lease that lives.
        for name in ("job_id", "token"):
            if mode is GenerationMode.POSITIVE and name in (case.path_parameters or {}):
                case.path_parameters[name] = lease[name]
        if isinstance(case.body, dict) and "wait_s" in case.body:
            case.body["wait_s"] = 0
        case.call_and_validate(base_url=str(lease["url"]), checks=CHECKS, timeout=30)

    ask()
