"""The commands ``buildarena admin``, for operators of a service."""

from __future__ import annotations

from buildarena_cli.commands import artifacts, backups, keys, running, worker
from buildarena_cli.groups import new_group

app = new_group("Keys, workers, backups and the database of a service.")
app.command()(running.status)
app.command()(running.logs)
app.add_typer(keys.app, name="key")
app.command()(worker.worker)
app.command()(backups.backup)
app.command()(backups.restore)
app.command()(worker.migrate)
app.command()(worker.roles)
app.command("gc")(artifacts.collect)
