"""The runner protocol's part of the contract under generated requests of one who may."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import schemathesis
from hypothesis import HealthCheck, given, settings
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import live_api
from support.servers.runner_rig import Caller, waiting

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


def test_every_answer_is_a_documented_one(context) -> None:
    own = context.settings.model_copy(update={**WITH_KEYS, "require_keys": False, "lease_s": 60.0})
    with live_api(replace(context, settings=own)) as url:
        for number, (label, mode) in enumerate(WAYS):
            waiting(context, seed=number)
            lease = Caller(url, name=f"slot-{number}").lease()
            ask_oddly(url, OPERATIONS[label], mode, lease)


def ask_oddly(url: str, operation: Any, mode: GenerationMode, lease: dict[str, object]) -> None:
    @settings(
        max_examples=4,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy(generation_mode=mode))
    def ask(case) -> None:
        # Half of what is worth asking needs a lease that lives.
        for name in ("job_id", "token"):
            if mode is GenerationMode.POSITIVE and name in (case.path_parameters or {}):
                case.path_parameters[name] = lease[name]
        if isinstance(case.body, dict) and "wait_s" in case.body:
            case.body["wait_s"] = 0
        case.call_and_validate(base_url=url, checks=CHECKS, timeout=30)

    ask()
