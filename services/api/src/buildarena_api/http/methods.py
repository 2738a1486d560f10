"""Which methods a path has: any other is 405, whatever the router would make of it.

The router takes the first route that fits path and method, so that GET of a path that only takes
POST reached a neighbour with a parameter in that place, or the key check, and was answered by it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from starlette.types import ASGIApp, Receive, Scope, Send

from buildarena_api.http.problems import send_problem

PARAMETER = re.compile(r"\{[a-z_]+\}")
CONTROL = re.compile(r"[\x00-\x1f\x7f]")


class MethodMiddleware:
    """Middleware around the application.

    Args:
        app: The application.
        routes: Path template and methods of each route.
    """

    def __init__(self, app: ASGIApp, routes: Iterable[tuple[str, Iterable[str]]]) -> None:
        self._app = app
        methods: dict[str, set[str]] = {}
        for template, more in routes:
            methods.setdefault(template, set()).update(more)
        # The fewer parameters, the closer a template describes a path.
        ordered = sorted(methods, key=lambda template: len(PARAMETER.findall(template)))
        self._methods = [
            (path_pattern(template), sorted(methods[template])) for template in ordered
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, or refuses it for its method."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        if CONTROL.search(scope["path"]):
            # The router's patterns end before a last line break.
            await send_problem(send, 404, "no path has control characters")
            return
        allowed = self._allowed(scope["path"])
        if allowed and scope["method"] not in allowed:
            detail = f"this path has no {scope['method']}; it has {', '.join(allowed)}"
            await send_problem(send, 405, detail, headers={"Allow": ", ".join(allowed)})
            return
        await self._app(scope, receive, send)

    def _allowed(self, path: str) -> list[str]:
        for pattern, methods in self._methods:
            if pattern.fullmatch(path):
                return methods
        return []


def path_pattern(template: str) -> re.Pattern[str]:
    """What the paths of a route match."""
    fixed = [re.escape(part) for part in PARAMETER.split(template)]
    return re.compile("[^/]+".join(fixed))
