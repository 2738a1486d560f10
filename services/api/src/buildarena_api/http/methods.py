"""The methods of each path: any other is answered with 405, and GET includes HEAD.

The router takes the first route that fits path and method, so that GET of a path that only takes
POST reached a neighbour with a parameter in that place, or the key check, and was answered by it.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterable

from fastapi.routing import APIRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from buildarena_api.http.problems import ErrorCode, ProblemError

CONTROL = re.compile(r"[\x00-\x1f\x7f]")


class MethodMiddleware:
    """Middleware around the application."""

    def __init__(self, app: ASGIApp, routes: Iterable[APIRoute]) -> None:
        self._app = app
        methods: dict[str, set[str]] = {}
        # The fewer parameters, the closer a template describes a path.
        ordered = sorted(routes, key=lambda route: len(route.param_convertors))
        for route in ordered:
            names = methods.setdefault(route.path, set())
            names.update(route.methods or ())
            names.update({"HEAD"} if "GET" in names else ())
        patterns = {route.path: route.path_regex for route in ordered}
        self._methods = [(patterns[path], sorted(names)) for path, names in methods.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it for its method."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        if CONTROL.search(scope["path"]):
            # The router's patterns end before a last line break.
            detail = "no path has control characters"
            problem = ProblemError(ErrorCode.PATH_NOT_FOUND, detail)
            await problem.answer()(scope, receive, send)
            return
        all_methods = (methods for path, methods in self._methods if path.fullmatch(scope["path"]))
        allowed = next(all_methods, [])
        if allowed and scope["method"] not in allowed:
            detail = f"this path has no {scope['method']}; it has {', '.join(allowed)}"
            headers = {"Allow": ", ".join(allowed)}
            problem = ProblemError(ErrorCode.METHOD_NOT_ALLOWED, detail, headers=headers)
            await problem.answer()(scope, receive, send)
            return
        if scope["method"] == "HEAD" and allowed:
            await self._head(scope, send)
            return
        await self._app(scope, receive, send)

    async def _head(self, scope: Scope, send: Send) -> None:
        """Answer like GET, without a body; a stream ends at once."""
        begun = asyncio.Event()

        async def receive() -> Message:
            await begun.wait()
            return {"type": "http.disconnect"}

        async def send_head(message: Message) -> None:
            if message["type"] == "http.response.start":
                await send(message)
                await send({"type": "http.response.body", "body": b""})
                begun.set()

        got = {**scope, "method": "GET"}
        await self._app(got, receive, send_head)
        scope["route"] = got.get("route")
