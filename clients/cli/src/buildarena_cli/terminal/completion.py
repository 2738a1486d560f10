"""What the shell offers for a word that is not finished: ids, tasks, models.

Completions ask the API over a bare socket: loading any HTTP library takes longer than all the rest.
They wait at most a moment, and offer nothing when it does not answer.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any, Final

import typer

from buildarena_client.config import DEFAULT_URL, stored_key

if TYPE_CHECKING:
    from socket import socket

WITHIN_S: Final = 0.25
"""How long a completion waits for the API."""
MAX_OFFERED: Final = 50


def complete_job(ctx: typer.Context, incomplete: str) -> list[str]:
    """Ids of jobs that begin like this, the newest first."""
    return _ids(ctx, "job", "jobs", incomplete)


def complete_sweep(ctx: typer.Context, incomplete: str) -> list[str]:
    """Ids of sweeps that begin like this, the newest first."""
    return _ids(ctx, "sweep", "sweeps", incomplete)


def complete_key(ctx: typer.Context, incomplete: str) -> list[str]:
    """Ids of keys that begin like this."""
    return [key["id"] for key in _asked(ctx, "/v1/keys") or () if key["id"].startswith(incomplete)]


def complete_task(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of tasks."""
    return _names(ctx, "/v1/tasks", incomplete)


def complete_model(ctx: typer.Context, incomplete: str) -> list[str]:
    """Names of models."""
    return _names(ctx, "/v1/models", incomplete)


def _ids(ctx: typer.Context, kind: str, listed: str, incomplete: str) -> list[str]:
    prefix = f"{kind}_"
    if incomplete.startswith(prefix):
        prefix = incomplete
    elif not prefix.startswith(incomplete):
        return []
    if re.fullmatch("[a-z]+_[0-9a-f]*", prefix) is None:
        return []
    page = _asked(ctx, f"/v1/{listed}?id_prefix={prefix}&limit={MAX_OFFERED}")
    return [entry["id"] for entry in (page or {}).get(listed, ())]


def _names(ctx: typer.Context, path: str, incomplete: str) -> list[str]:
    names = [entry["name"] for entry in _asked(ctx, path) or ()]
    return [name for name in names if name.startswith(incomplete)]


def _asked(ctx: typer.Context, path: str) -> Any:
    """The API's answer; None for whatever goes wrong: a shell's prompt is no place for errors."""
    import json
    from urllib.parse import urlsplit

    url = ctx.params.get("url") or os.environ.get("BUILDARENA_URL") or DEFAULT_URL
    try:
        parts = urlsplit(url)
        with _connected(parts.hostname or "", parts.port, tls=parts.scheme == "https") as server:
            server.sendall(_request(parts.netloc, parts.path.rstrip("/") + path))
            with server.makefile("rb") as answer:
                head, _, body = answer.read().partition(b"\r\n\r\n")
        return json.loads(body) if head.split()[1:2] == [b"200"] else None
    except (OSError, ValueError):
        return None


def _connected(host: str, port: int | None, *, tls: bool) -> socket:
    from socket import create_connection

    plain = create_connection((host, port or (443 if tls else 80)), timeout=WITHIN_S)
    if not tls:
        return plain
    import ssl

    return ssl.create_default_context().wrap_socket(plain, server_hostname=host)


def _request(host: str, path: str) -> bytes:
    """A GET of HTTP 1.0, whose answer is one piece that ends with the connection."""
    key = stored_key()
    authorization = f"Authorization: Bearer {key}\r\n" if key else ""
    return f"GET {path} HTTP/1.0\r\nHost: {host}\r\n{authorization}\r\n".encode()
