"""The OpenAPI contract, and requests that are generated from a part of it."""

from collections.abc import Callable
from typing import Any

import schemathesis
from hypothesis import HealthCheck, given, settings
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from support.contract import contract

SCHEMA = schemathesis.openapi.from_dict(contract())
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]


def ways(schema: Any) -> list[tuple[Any, GenerationMode]]:
    """Its operations, each asked rightly, and wrongly if it takes any input."""
    return [
        (operation, mode)
        for operation in (found.ok() for found in schema.get_all_operations())
        for mode in GenerationMode
        if mode is GenerationMode.POSITIVE or operation.body or list(operation.iter_parameters())
    ]


def ask(
    url: str,
    way: tuple[Any, GenerationMode],
    examples: int,
    prepare: Callable[[Any], None],
    **headers: str,
) -> None:
    """Sends generated requests, each prepared first, and checks the answers."""
    operation, mode = way

    @settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy(generation_mode=mode))
    def asked(case: Any) -> None:
        prepare(case)
        case.call_and_validate(base_url=url, headers=headers, checks=CHECKS, timeout=30)

    asked()
