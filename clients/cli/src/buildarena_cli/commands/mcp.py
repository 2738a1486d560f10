"""`buildarena mcp`: this service's tools for agents, over the Model Context Protocol."""

from __future__ import annotations

from typing import Annotated

import typer

from buildarena_cli.options import ServiceOption


def mcp(
    *,
    http: Annotated[
        int | None, typer.Option("--http", help="Serve streamable HTTP on this loopback port.")
    ] = None,
    client: ServiceOption,
) -> None:
    """Serve building tools to agents over the Model Context Protocol.

    Their machines are simulated and scored like all others, on a separate track.
    """
    import asyncio

    from buildarena_cli.mcp_server import make_server, serve_stdio

    if http is None:
        asyncio.run(serve_stdio(client))
        return
    import uvicorn

    server = make_server(client).streamable_http_app()
    uvicorn.run(server, host="127.0.0.1", port=http, log_level="warning")
