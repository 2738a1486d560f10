"""The API in the test's process: over real HTTP in a thread, or called as a function."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import structlog
import uvicorn
from starlette.testclient import TestClient

from buildarena_api.app import create_app
from buildarena_cli.local import free_port
from buildarena_pipeline.catalog.models import load_registry
from buildarena_pipeline.runtime.context import Context, open_context

LOOPBACK = "http://127.0.0.1"
"""What a client in the test's process calls the API: a service without keys has no other name."""


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
    return TestClient(create_app(context, load_registry()), base_url=LOOPBACK, **options)


@contextmanager
def live_api(context: Context) -> Iterator[str]:
    """Serves the API of a context; yields its URL."""
    # Commands run in this process too: its log must not be part of what they print, nor of what the
    # suite prints.
    usual_logs = structlog.get_config()
    structlog.configure(logger_factory=structlog.ReturnLoggerFactory())
    port = free_port()
    config = uvicorn.Config(
        create_app(context, load_registry()),
        host="127.0.0.1",
        port=port,
        log_config=None,
        proxy_headers=False,
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    try:
        yield f"http://127.0.0.1:{port}"
    finally:
        server.should_exit = True
        thread.join()
        structlog.configure(**usual_logs)
