"""Paths of the API: what is not a name never becomes a part of one."""

from __future__ import annotations

import re
from typing import Final
from urllib.parse import quote

from buildarena_client.errors import BadArgumentError

HEALTH: Final = "/v1/health"
PATH: Final = re.compile(r"/v1(?:/(?!\.{1,2}(?:/|\?|$))[A-Za-z0-9._~%-]+)+(?:\?[!-\"$-~]*)?")
"""Pattern of valid paths: their parts are quoted, and none leads elsewhere."""


def at(*parts: str) -> str:
    """Return the path of an object in the API; its parts cannot reach another route.

    Raises:
        BadArgumentError: A part is not a name.
    """
    for part in parts:
        # A server takes %2F for a slash.
        readable = isinstance(part, str) and part.isprintable()
        if not readable or part in {"", ".", ".."} or "/" in part:
            raise BadArgumentError(f"{part!r} is not a name")
    return "/v1/" + "/".join(quote(part, safe="") for part in parts)


def checked_path(path: str) -> str:
    """Check that a path leads to the service and nowhere else, and return it.

    Raises:
        BadArgumentError: It could lead elsewhere.
    """
    if PATH.fullmatch(path) is None:
        raise BadArgumentError(f"{path!r} is not a path of the service")
    return path
