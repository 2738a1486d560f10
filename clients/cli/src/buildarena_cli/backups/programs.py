"""Postgres' programs for dumps: those of the embedded server, or installed ones."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

from sqlalchemy import make_url

from buildarena_backend.errors import StartupError
from buildarena_cli.errors import CommandError
from buildarena_cli.local.postgres import installed_postgres

PASSED_ON = ("PATH", "HOME", "LANG", "SSL_CERT_FILE", "PGSSLMODE", "PGSSLROOTCERT", "TMPDIR")


def run_program(name: str, url: str, *arguments: str) -> None:
    """Run ``pg_dump`` or ``pg_restore`` on a database.

    Args:
        url: URL of the database; its password does not appear in lists of processes.
        arguments: Additional arguments.

    Raises:
        CommandError: The program failed or is not installed.
    """
    done = subprocess.run(
        [str(_program(name)), "--no-password", *arguments],
        env=_environment(url),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        complaint = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        raise CommandError(f"{name}: {' '.join(complaint[-3:])}")


def _program(name: str) -> Path:
    try:
        folder = installed_postgres() / "bin"
    except StartupError:
        folder = None
    program = shutil.which(name, path=str(folder)) if folder else None
    program = program or shutil.which(name)
    if program is None:
        raise CommandError(
            f"{name} is not installed: install Postgres' client programs, of the server's version "
            "or a newer one"
        )
    return Path(program)


def _environment(url: str) -> Mapping[str, str]:
    parsed = make_url(url)
    connection = {
        "PGHOST": parsed.host,
        "PGPORT": str(parsed.port) if parsed.port else None,
        "PGUSER": parsed.username,
        "PGPASSWORD": parsed.password,
        "PGDATABASE": parsed.database,
        "PGSSLMODE": str(parsed.query["sslmode"]) if "sslmode" in parsed.query else None,
        "PGCONNECT_TIMEOUT": "10",
    }
    passed_on = {name: os.environ[name] for name in PASSED_ON if name in os.environ}
    return passed_on | {name: value for name, value in connection.items() if value is not None}
