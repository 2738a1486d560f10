"""Prints the API's contract, or with ``--callers`` its operations and their permitted callers.

Usage: ``python -m buildarena_api.contract [--callers]``.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from fastapi.routing import APIRoute

from buildarena_api.access import READING, admin_of
from buildarena_api.app import all_routes, create_app
from buildarena_api.http.openapi import api_page
from buildarena_api.routes import health, keys, runner
from buildarena_backend.catalog.models import load_registry
from buildarena_backend.process.context import open_context
from buildarena_backend.settings import Settings


def contract() -> dict[str, Any]:
    """Return the OpenAPI document; no database or broker is contacted."""
    settings = Settings(
        database_url="postgresql://nobody@127.0.0.1:1/none", broker_url="redis://127.0.0.1:1/0"
    )
    context = open_context(settings)
    try:
        return create_app(context, load_registry()).openapi()
    finally:
        context.close()


def operations() -> list[tuple[str, str, str, str]]:
    """Return method, path, name and least scope of every operation; "none" needs no key."""
    special = {"none": health.router, "runner": runner.router, "admin": keys.router}
    scope_of = {id(route): scope for scope, router in special.items() for route in router.routes}
    return [
        (method, route.path, route.name, scope_of.get(id(route)) or _least_scope(route, method))
        for route in all_routes()
        if route.include_in_schema
        for method in sorted(route.methods or ())
    ]


def operations_page() -> str:
    """Return the document about the API with the table of its operations."""
    rows = [f"| {method} {path} | {name} | {scope} |" for method, path, name, scope in operations()]
    head = ["", "Each operation, and the least scope of a key that may call it:", ""]
    table = ["| operation | name | scope |", "|---|---|---|", *rows]
    return api_page() + "\n".join([*head, *table]) + "\n"


def _least_scope(route: APIRoute, method: str) -> str:
    if any(inner.call is admin_of for inner in route.dependant.dependencies):
        return "admin"
    return "read" if method in READING else "submit"


if __name__ == "__main__":
    if "--callers" in sys.argv:
        for row in operations():
            sys.stdout.write("{3:7} {0:7} {1}  {2}\n".format(*row))
    else:
        sys.stdout.write(json.dumps(contract(), indent=1, sort_keys=True) + "\n")
