"""The commands ``buildarena admin``, for operators of a service."""

from __future__ import annotations

from buildarena_cli.lazy import AdminGroup, new_group

app = new_group("Keys, workers, backups and the database of a service.", AdminGroup)


@app.callback()
def _admin() -> None:
    """Keys, workers, backups and the database of a service."""
