"""A reverse proxy in front of a service: passes bytes on as they come."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import httpx
import uvicorn
from starlette.applications import Starlette
from starlette.background import BackgroundTask
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route
from support.servers.live_api import in_a_thread

from buildarena_cli.local.server import free_port

METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"]


@dataclass(frozen=True, kw_only=True)
class ProxyRules:
    """What a proxy does with requests.

    Attributes:
        prefix: Path below which it shows the service; others get 404.
        cuts: Whether it cuts the prefix off before it passes a request on.
    """

    prefix: str = ""
    cuts: bool = False


@contextmanager
def reverse_proxy(upstream: str, rules: ProxyRules) -> Iterator[str]:
    """Runs one in a thread; yields its URL with the prefix."""

    async def passed_on(request: Request) -> Response:
        path = request.scope["raw_path"].decode()
        if path != rules.prefix and not path.startswith(f"{rules.prefix}/"):
            return Response(status_code=404)
        if rules.cuts:
            path = path.removeprefix(rules.prefix) or "/"
        client = httpx.AsyncClient(base_url=upstream, timeout=None, verify=False)
        given = {"headers": request.headers.raw, "content": await request.body()}
        asked = client.build_request(request.method, f"{path}?{request.url.query}", **given)
        answer = await client.send(asked, stream=True)
        given = {"headers": answer.headers, "background": BackgroundTask(client.aclose)}
        return StreamingResponse(answer.aiter_raw(), answer.status_code, **given)

    app = Starlette(routes=[Route("/{path:path}", passed_on, methods=METHODS)])
    config = uvicorn.Config(app, port=free_port(), ws="none", log_config=None, access_log=False)
    with in_a_thread(config) as url:
        yield f"{url}{rules.prefix}"
