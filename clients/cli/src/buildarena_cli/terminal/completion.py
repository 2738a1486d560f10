"""What the shell offers for a word that is not finished: ids, tasks, models.

Completions ask the API by the standard library alone, which loads in a tenth of the time that a
whole client takes, wait at most a moment, and offer nothing when it does not answer.
"""

from __future__ import annotations

import os
from typing import Any, Final

import typer

from buildarena_cli.defaults import DEFAULT_URL, KEY_VARIABLE

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
    page = _asked(ctx, f"/v1/{listed}?id_prefix={prefix}&limit={MAX_OFFERED}")
    return [entry["id"] for entry in (page or {}).get(listed, ())]


def _names(ctx: typer.Context, path: str, incomplete: str) -> list[str]:
    names = [entry["name"] for entry in _asked(ctx, path) or ()]
    return [name for name in names if name.startswith(incomplete)]


def _asked(ctx: typer.Context, path: str) -> Any:
    """The API's answer; None for whatever goes wrong: a shell's prompt is no place for errors."""
    import json
    from http.client import HTTPConnection, HTTPException, HTTPSConnection
    from urllib.parse import urlsplit

    url = ctx.params.get("url") or os.environ.get("BUILDARENA_URL") or DEFAULT_URL
    key = os.environ.get(KEY_VARIABLE)
    try:
        parts = urlsplit(url)
        kind = HTTPSConnection if parts.scheme == "https" else HTTPConnection
        connection = kind(parts.hostname or "", parts.port, timeout=WITHIN_S)
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        connection.request("GET", parts.path.rstrip("/") + path, headers=headers)
        response = connection.getresponse()
        body = response.read()
        connection.close()
        return json.loads(body) if response.status < 300 else None  # noqa: PLR2004 - HTTP
    except (OSError, HTTPException, ValueError):
        return None
