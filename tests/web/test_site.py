"""A published site in a real browser, from a plain file server, under a sub-path."""

import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx
import pytest
from support.documents.pages import BUILDARENA, LOOKS, in_browser, needs_pages
from support.servers.stacks import finished, running_stack

pytestmark = [*needs_pages, pytest.mark.nightly]

SWEEP = {
    "name": "published",
    "tasks": ["support-1", "lift-1"],
    "models": ["builtin/expert", "builtin/random", "builtin/idle"],
    "seeds": [0, 1],
    "simulator": "mujoco",
}
NAME = "</script><img src=x onerror=alert(1)>another"
OTHER = {**SWEEP, "name": NAME, "tasks": ["support-1"], "seeds": [1]}
PLACE = "some/where"


@contextmanager
def file_server(folder: Path) -> Iterator[str]:
    """Serves a folder as any static host does; yields its address."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - its name
            pass

    class Server(ThreadingHTTPServer):
        def handle_error(self, request: object, client_address: object) -> None:
            """Browsers hang up when a page is closed."""

    server = Server(("127.0.0.1", 0), partial(Quiet, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@pytest.mark.parametrize("looks", LOOKS)
def test_a_site_works_from_a_file_server(tmp_path, looks) -> None:
    host = tmp_path / "host"
    with running_stack(tmp_path) as stack, file_server(host) as address:
        with httpx.Client(base_url=stack.url) as client:
            sweeps = [
                client.post("/v1/sweeps", json=spec).raise_for_status().json()["id"]
                for spec in (SWEEP, OTHER)
            ]
            for sweep in sweeps:
                finished(client, sweep)
        for name in ("all", "best"):
            out = host / PLACE / name
            words = ["--out", str(out), "--jobs", name, "--url", stack.url]
            subprocess.run([BUILDARENA, "site", *sweeps, *words], check=True, timeout=120)
        in_browser(
            stack.url,
            ["e2e/site"],
            BUILDARENA_WEB_SITES=",".join(f"{address}{PLACE}/{name}/" for name in ("all", "best")),
            **looks,
        )
