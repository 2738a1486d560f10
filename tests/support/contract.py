"""The API's contract, made once a process."""

from functools import cache
from typing import Any

from buildarena_api import contract as api


@cache
def contract() -> dict[str, Any]:
    """The OpenAPI document of the code that is tested."""
    return api.contract()
