"""Postgres' programs for dumps: those of the embedded server, or installed ones."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess

from sqlalchemy import make_url

from buildarena_backend.errors import StartupError
from buildarena_cli.errors import CommandError
from buildarena_cli.local.postgres import installed_postgres


def run_program(name: str, url: str, *arguments: str) -> None:
    """Run ``pg_dump`` or ``pg_restore`` on a database.

    Args:
        url: URL of the database; its password does not appear in lists of processes.
        arguments: Additional arguments.

    Raises:
        CommandError: The program failed or is not installed.
    """
    address = make_url(url).set(drivername="postgresql")
    environment = {**os.environ, "PGCONNECT_TIMEOUT": "10"}
    if address.password:
        environment["PGPASSWORD"] = address.password
    database = address._replace(password=None).render_as_string()
    done = subprocess.run(
        [_program(name), "--no-password", f"--dbname={database}", *arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        complaint = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        raise CommandError(f"{name}: {' '.join(complaint[-3:])}")


def _program(name: str) -> str:
    places = [os.environ.get("PATH", os.defpath)]
    with contextlib.suppress(StartupError):
        places.insert(0, str(installed_postgres() / "bin"))
    program = shutil.which(name, path=os.pathsep.join(places))
    if program is None:
        raise CommandError(
            f"{name} is not installed: install Postgres' client programs, of the server's version "
            "or a newer one"
        )
    return program
