"""The doctor: what is wrong with a running service, and what to do."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rich.table import Table

from buildarena_cli.client import Client
from buildarena_cli.output import console, print_json
from buildarena_pipeline.runtime.settings import Settings

MEBIBYTE = 1024 * 1024


def examine(client: Client, *, as_json: bool) -> bool:
    """Asks the service how it is and prints the answer.

    Returns:
        True when nothing is wrong.
    """
    health: dict[str, Any] = client.get("/v1/health")
    peak = _peak_memory_bytes(client.url)
    if as_json:
        print_json({**health, "peak_memory_bytes": peak})
        return bool(health["status"] == "ok")
    table = Table(title=f"BuildArena at {client.url}: {health['status']}", title_justify="left")
    for column in ("", "check", "finding", "what to do"):
        table.add_column(column, overflow="fold")
    for check in health["checks"]:
        mark = "ok" if check["ok"] else "!!"
        table.add_row(mark, check["name"], check["detail"], check["advice"])
    if peak is not None:
        table.add_row("ok", "memory", f"{peak / MEBIBYTE:,.0f} MiB at the peak, all processes", "")
    console.print(table)
    return bool(health["status"] == "ok")


def _peak_memory_bytes(url: str) -> int | None:
    """The peak that the local stack at this URL noted, if it is one of this folder's."""
    data = Settings().data
    for run in (data / "run.json", data / "demo" / "run.json"):
        noted = _read(run)
        if noted.get("url") == url:
            return int(noted["peak_memory_bytes"])
    return None


def _read(path: Path) -> dict[str, Any]:
    try:
        noted: dict[str, Any] = json.loads(path.read_text())
    except (OSError, ValueError):
        return {}
    return noted
