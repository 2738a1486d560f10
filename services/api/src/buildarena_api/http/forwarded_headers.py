"""The service's public address: the path prefix and host name behind a proxy.

Without keys, the names in a request also decide whether it is allowed.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from ipaddress import ip_address, ip_network

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from buildarena_api.http.problems import ErrorCode, ProblemError


class Networks:
    """Addresses and networks, separated by commas; an address is in them, or is not."""

    def __init__(self, named: str) -> None:
        self._networks = [ip_network(part) for part in named.split(",") if part]

    def __contains__(self, address: str) -> bool:
        """Return whether an address is one of them; False for malformed addresses."""
        try:
            return any(ip_address(address) in network for network in self._networks)
        except ValueError:
            return False


class BasePathMiddleware:
    """Serves everything below a path too, as a proxy asks for it that passes paths on unchanged.

    Paths without it are served as well: some proxies cut it off, and probes inside a cluster don't
    know of it. Either way `Location` and the contract's server name it.

    Args:
        base: For example ``/arena``; no slash at its end.
    """

    def __init__(self, app: ASGIApp, base: str) -> None:
        self._app = app
        self._base = base

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on without the base path."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        path: str = scope["path"]
        if path == self._base or path.startswith(f"{self._base}/"):
            path = path.removeprefix(self._base) or "/"
        inner = {**scope, "path": path, "raw_path": None}

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = message.get("headers", [])
                message = {**message, "headers": [self._outer(*header) for header in headers]}
            await send(message)

        await self._app(inner, receive, sending)

    def _outer(self, name: bytes, value: bytes) -> tuple[bytes, bytes]:
        if name.lower() != b"location":
            return name, value
        return name, self._base.encode() + value


class RootPathMiddleware:
    """Adds the base path for the router, as ASGI has it: to the root path and to the path.

    It is the last before the router: everything before it uses the routes' paths.
    """

    def __init__(self, app: ASGIApp, base: str) -> None:
        self._app = app
        self._base = base

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on; the router notes its route in the same scope."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        path = scope["path"]
        scope.update(path=self._base + path, root_path=self._base)
        try:
            await self._app(scope, receive, send)
        finally:
            scope.update(path=path, root_path="")


OCTET = r"(?:25[0-5]|2[0-4][0-9]|1[0-9]{2}|[1-9]?[0-9])"
LOOPBACK_HOST = re.compile(
    rf"(?:localhost|127\.{OCTET}\.{OCTET}\.{OCTET}|\[::1\])(?::[0-9]{{1,5}})?", re.IGNORECASE
)


class LocalOnlyMiddleware:
    """Restricts a service without keys to programs and pages of this machine.

    A browser lets any page send requests to loopback. Without keys nothing in such a request shows
    that its sender may, so the names in it must be this machine's (DNS rebinding has a foreign
    `Host`), and it must not come from a foreign page (`Origin`, `Sec-Fetch-Site`). Only a link to
    one of our pages may be on any site: a page contains no data, and calls the API as one of ours.

    Args:
        is_page: Whether a path is a page's, which a link on any site may open.
    """

    def __init__(self, app: ASGIApp, is_page: Callable[[str], bool] = lambda _: False) -> None:
        self._app = app
        self._is_page = is_page

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it for its origin."""
        refusal = self._refusal(scope) if scope["type"] == "http" else None
        answer = self._app if refusal is None else refusal.answer()
        await answer(scope, receive, send)

    def _refusal(self, scope: Scope) -> ProblemError | None:
        """Return the reason to refuse the request, or None."""
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
        """Return whether the request navigates to a page, unlike frames, scripts and forms."""
        return (
            scope["type"] == "http"
            and scope["method"] == "GET"
            and _values(scope, b"sec-fetch-mode") == ["navigate"]
            and _values(scope, b"sec-fetch-dest") == ["document"]
            and self._is_page(scope["path"])
        )


def _values(scope: Scope, name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in scope["headers"] if key == name]
