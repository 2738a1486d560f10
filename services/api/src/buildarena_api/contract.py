"""Prints the OpenAPI contract: ``python -m buildarena_api.contract``."""

from __future__ import annotations

import json
import sys
from typing import Any

from buildarena_api.app import create_app
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


if __name__ == "__main__":
    sys.stdout.write(json.dumps(contract(), indent=1, sort_keys=True) + "\n")
