"""Who may ask a service without keys: programs and pages of this machine, nobody else's pages.

A browser lets any page send requests to loopback. Without keys nothing in such a request says that
its sender may, so the names in it must be this machine's own (DNS rebinding has a foreign `Host`),
and it must not come from a foreign page (`Origin`, `Sec-Fetch-Site`). Only a link to one of our own
pages may stand anywhere: a page says nothing by itself, and asks the API as one of ours.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from starlette.types import ASGIApp, Receive, Scope, Send

from buildarena_api.http.codes import ErrorCode
from buildarena_api.http.problems import ProblemError, send_problem

OCTET = r"(?:25[0-5]|2[0-4][0-9]|1[0-9]{2}|[1-9]?[0-9])"
LOOPBACK_HOST = re.compile(
    rf"(?:localhost|127\.{OCTET}\.{OCTET}\.{OCTET}|\[::1\])(?::[0-9]{{1,5}})?", re.IGNORECASE
)


class LocalOnlyMiddleware:
    """Middleware around an application that asks for no keys.

    Args:
        app: The application.
        is_page: Whether a path is a page's, which a link on any site may open.
    """

    def __init__(self, app: ASGIApp, is_page: Callable[[str], bool] = lambda _: False) -> None:
        self._app = app
        self._is_page = is_page

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Passes a request on, or refuses it for where it comes from."""
        refusal = self._refusal(scope) if scope["type"] == "http" else None
        if refusal is None:
            await self._app(scope, receive, send)
        else:
            await send_problem(send, refusal)

    def _refusal(self, scope: Scope) -> ProblemError | None:
        """Why the request is not to be served, if it is not."""
        hosts, origins = _values(scope, b"host"), _values(scope, b"origin")
        if len(hosts) != 1 or LOOPBACK_HOST.fullmatch(hosts[0]) is None:
            named = ", ".join(map(repr, hosts)) or "nothing"
            return ProblemError(
                ErrorCode.FOREIGN_HOST,
                f"Host names {named[:200]}: without keys this service answers only to localhost, "
                "127.0.0.0/8 and [::1] (BUILDARENA_REQUIRE_KEYS=true lets it have other names)",
            )
        own = {f"{scheme}://{hosts[0].lower()}" for scheme in ("http", "https")}
        if len(origins) > 1 or any(origin.lower() not in own for origin in origins):
            detail = "requests of other origins' pages are not served without keys"
            return ProblemError(ErrorCode.FOREIGN_ORIGIN, detail)
        if "cross-site" in _values(scope, b"sec-fetch-site") and not self._is_link(scope):
            detail = "requests that a foreign site makes are not served without keys"
            return ProblemError(ErrorCode.FOREIGN_ORIGIN, detail)
        return None

    def _is_link(self, scope: Scope) -> bool:
        """Whether somebody followed a link to a page: no frame, script or form does just this."""
        return (
            scope["type"] == "http"
            and scope["method"] == "GET"
            and _values(scope, b"sec-fetch-mode") == ["navigate"]
            and _values(scope, b"sec-fetch-dest") == ["document"]
            and self._is_page(scope["path"])
        )


def _values(scope: Scope, name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in scope["headers"] if key == name]
