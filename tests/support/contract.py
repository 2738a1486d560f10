"""The API's contract, made once a process."""

import json
from functools import cache
from typing import Any

from buildarena_api import contract as api


@cache
def contract() -> dict[str, Any]:
    """The OpenAPI document of the code that is tested, in the order in which it is written."""
    return json.loads(json.dumps(api.contract(), sort_keys=True))
