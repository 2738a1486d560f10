"""PgBouncer in transaction mode before a Postgres, from Debian's package."""

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import psycopg
import pytest
from support.servers.stacks import wait_until

from buildarena_cli.local.program_copy import run_as, unprivileged_account
from buildarena_cli.local.server import free_port

PGBOUNCER = shutil.which("pgbouncer") or shutil.which("pgbouncer", path="/usr/sbin")

needs_pgbouncer = pytest.mark.skipif(
    PGBOUNCER is None, reason="poolers need pgbouncer: install the Debian packages pgbouncer"
)


@contextmanager
def pgbouncer(url: str, folder: Path, *, servers: int = 3) -> Iterator[str]:
    """The URL of a database by way of a pooler that has so few connections to it."""
    target, port = urlsplit(url), free_port()
    name = target.path.removeprefix("/")
    login = f"user={target.username} password={target.password or ''}"
    settings = folder / "pgbouncer.ini"
    settings.write_text(
        "[databases]\n"
        f"{name} = host={target.hostname} port={target.port} dbname={name} {login}\n"
        "[pgbouncer]\n"
        f"listen_addr = 127.0.0.1\nlisten_port = {port}\nunix_socket_dir =\n"
        f"auth_type = any\npool_mode = transaction\ndefault_pool_size = {servers}\n"
        "max_client_conn = 200\n"
    )
    account = unprivileged_account()
    if account is not None:
        for path in (folder, *folder.parents):
            if path.is_relative_to("/tmp") and path != Path("/tmp"):
                path.chmod(path.stat().st_mode | 0o011)
        settings.chmod(0o644)
    words, account_of = [str(PGBOUNCER), "-q", str(settings)], run_as(account)
    with subprocess.Popen(words, stdin=subprocess.DEVNULL, **account_of) as process:
        pooled = target._replace(netloc=f"{target.username}@127.0.0.1:{port}").geturl()
        try:
            wait_until(lambda: _answers(pooled), 20, "PgBouncer answers")
            yield pooled
        finally:
            process.terminate()


def _answers(url: str) -> bool:
    try:
        psycopg.connect(url, prepare_threshold=None).close()
    except psycopg.OperationalError:
        return False
    return True
