"""Former names of query parameters: read for one release, with a deprecation header."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final
from urllib.parse import parse_qsl, urlencode

from starlette.types import ASGIApp, Message, Receive, Scope, Send

PATHS: Final = re.compile(r"/v1/leaderboard(?:/.*)?")
FORMER: Final[Mapping[str, str]] = MappingProxyType({"reading": "policy"})
"""Present names by former ones, of the queries of `PATHS`."""


class FormerNamesMiddleware:
    """Passes queries on in present words.

    Source of the header: RFC 9745.

    Args:
        app: The application.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on."""
        query = []
        if scope["type"] == "http" and PATHS.fullmatch(scope["path"]):
            query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        used = [name for name, _ in query if name in FORMER]
        if not used:
            await self._app(scope, receive, send)
            return
        present = urlencode([(FORMER.get(name, name), value) for name, value in query])
        said = ", ".join(f"{name} is now {FORMER[name]}" for name in dict.fromkeys(used))

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                told = [(b"deprecation", b"@1795392000"), (b"warning", f'299 - "{said}"'.encode())]
                message = {**message, "headers": [*message.get("headers", []), *told]}
            await send(message)

        await self._app({**scope, "query_string": present.encode()}, receive, sending)
