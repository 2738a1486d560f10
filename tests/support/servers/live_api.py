"""The API in the test's process: over real HTTP in a thread, or called as a function.

FastAPI prepares an app's routes at its first request, which takes a quarter of a second. No route
says of which app it is, so that all apps of a test process share those of the first.
"""

import asyncio
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import structlog
import uvicorn
from fastapi import FastAPI
from fastapi.dependencies import models
from fastapi.routing import _IncludedRouter
from starlette.testclient import TestClient
from support.paid_models import REGISTRY

from buildarena_api.app import create_app
from buildarena_api.http.door import server_config
from buildarena_backend.process.context import Context, open_context
from buildarena_cli.local.server import free_port

LOOPBACK = "http://127.0.0.1"
"""What a client in the test's process calls the API: a service without keys has no other name."""
ROUTES: list[_IncludedRouter] = []
"""Those of the first app."""
CACHES = [value for value in vars(models).values() if hasattr(value, "cache_clear")]
"""FastAPI remembers functions of the last thousand apps, and these their apps: gigabytes."""
TICK_S = 0.01
"""How often a server looks whether it shall end; uvicorn's own waits a tenth of a second, twice."""


def app_of(context: Context) -> FastAPI:
    """The application, with routes that may have been used before."""
    app = create_app(context, REGISTRY)
    routes = app.router.routes
    own = [number for number, route in enumerate(routes) if isinstance(route, _IncludedRouter)]
    if not ROUTES:
        ROUTES.extend(routes[number] for number in own)
    for number, route in zip(own, ROUTES, strict=True):
        routes[number] = route
    return app


def forget_apps() -> None:
    """Clears what FastAPI remembers of apps."""
    for cache in CACHES:
        cache.cache_clear()


class PromptServer(uvicorn.Server):
    """Ends as soon as it is told to."""

    async def main_loop(self) -> None:
        tick = 0
        while not await self.on_tick(tick):
            tick += 1
            await asyncio.sleep(TICK_S)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        del sockets
        for server in self.servers:
            server.close()
        for connection in list(self.server_state.connections):
            connection.shutdown()
        while self.server_state.connections or self.server_state.tasks:  # noqa: ASYNC110
            await asyncio.sleep(TICK_S)
        for server in self.servers:
            await server.wait_closed()
        await self.lifespan.shutdown()


@contextmanager
def in_a_thread(config: uvicorn.Config) -> Iterator[str]:
    """Serves until the block is left; yields the URL."""
    server = PromptServer(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    try:
        yield f"{LOOPBACK}:{config.port}"
    finally:
        server.should_exit = True
        thread.join()


@contextmanager
def changed(context: Context, **settings: Any) -> Iterator[Context]:
    """Connections of a process of their own, with other settings."""
    own = open_context(context.settings.model_copy(update=settings))
    try:
        yield own
    finally:
        own.close()


def api_client(context: Context, **options: Any) -> TestClient:
    """Calls the API of a context as a function."""
    return TestClient(app_of(context), base_url=LOOPBACK, **options)


@contextmanager
def live_api(context: Context, **settings: Any) -> Iterator[str]:
    """Serves the API of a context, or with settings a changed one's; yields its URL."""
    if settings:
        with changed(context, **settings) as own, live_api(own) as url:
            yield url
        return
    # Commands run in this process too: its log must not be part of what they print, nor of what the
    # suite prints.
    usual_logs = structlog.get_config()
    structlog.configure(logger_factory=structlog.ReturnLoggerFactory())
    port = free_port()
    config = server_config(app_of(context), context.settings, host="127.0.0.1", port=port)
    try:
        with in_a_thread(config) as url:
            yield url
    finally:
        structlog.configure(**usual_logs)
