"""The whole service on one machine: servers, API and workers as children of this process."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import IO, Self

import httpx2
import psutil

from buildarena_backend.accounts.keys import new_secret
from buildarena_backend.database.database import Database
from buildarena_backend.errors import SchemaVersionError, StartupError
from buildarena_backend.secret_files import SUFFIX
from buildarena_backend.settings import PREFIX, SECRETS, Settings
from buildarena_backend.states import CONSTRUCT_QUEUE
from buildarena_backend.trials.installed_simulators import installed_engines
from buildarena_backend.workers import Workers
from buildarena_benchmark.environment.trials.processes import ALLOCATOR, PARENT
from buildarena_cli.errors import CommandError
from buildarena_cli.local.postgres import EmbeddedPostgres
from buildarena_cli.local.programs import programs
from buildarena_cli.local.server import EmbeddedValkey, secret_in
from buildarena_cli.local.service import LOCK, RUN, Run, log_name, unwritable
from buildarena_cli.local.supervisor import ManagedProcess, Supervisor
from buildarena_client.paths import HEALTH

KEYS = ("admin_key", "previous_admin_key", "metrics_key")
"""Settings that are keys: no process gets them where none are asked for."""
READY_WITHIN_S = 60.0
LOCK_ATTEMPTS = 5
LOCK_AGAIN_S = 0.05


class Stack:
    """Everything that `buildarena up` runs. Use as a context manager; leaving it stops all.

    Args:
        settings: Settings such as the data folder and the API's port.
        report: Receives a line for each started part.
        simulators: Simulators to start workers for; by default all engines that are installed.

    Attributes:
        environment: Environment variables of its programs, also for additional workers.
    """

    def __init__(
        self,
        settings: Settings,
        *,
        report: Callable[[str], None] = lambda _: None,
        simulators: Sequence[str] | None = None,
    ) -> None:
        self.settings = settings
        self.admin_key: str | None = None
        self.environment: dict[str, str] = {}
        self.url = f"http://{settings.host}:{settings.port}"
        self.supervisor = Supervisor(stop_within_s=settings.stop_grace_s, on_change=self._write_run)
        self._report = report
        self._simulators = installed_engines() if simulators is None else simulators
        self._lock: IO[str] | None = None
        self._ready = False
        self._writing = threading.Lock()

    def __enter__(self) -> Self:
        try:
            self._start()
        except (StartupError, SchemaVersionError, OSError, subprocess.SubprocessError) as error:
            self.stop()
            raise CommandError(str(error)) from error
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def logs(self) -> Path:
        """Folder of the processes' logs."""
        return self.settings.data.absolute() / "logs"

    def stop(self) -> None:
        """Stop everything that was started."""
        self.supervisor.stop()
        if self._lock is not None:
            self._write_run()
            self._lock.close()
            self._lock = None

    def require_running(self) -> None:
        """Check that no process has failed permanently.

        Raises:
            CommandError: One was; the message names it.
        """
        if self.supervisor.failed is not None:
            raise CommandError(f"{self.supervisor.failed} (see {self.logs})")

    def _start(self) -> None:
        self._take_folder()
        _require_free_port(self.settings.host, self.settings.port)
        environment = self.environment = self._start_servers()
        self._report("migrating the database")
        direct = self.settings.database_direct_url
        database = Database(direct or environment["BUILDARENA_DATABASE_URL"])
        database.migrate()
        # Those of a run that was killed, which would be reported as silent for an hour.
        Workers(database).forget_ended(socket.gethostname(), psutil.pid_exists)
        database.close()
        for program in programs(self._simulators):
            self._report(f"starting the {program.name}")
            self._launch_program(program.name, program.arguments, environment)
        self.supervisor.watch()
        self._wait_until_healthy()
        self._ready = True
        self._write_run()

    def _take_folder(self) -> None:
        data = self.settings.data.absolute()
        try:
            self.logs.mkdir(parents=True, exist_ok=True)
            lock = (data / LOCK).open("w")
        except OSError as error:
            raise unwritable(data, error) from error
        try:
            _locked(lock)
        except OSError as error:
            lock.close()
            raise CommandError(
                f"another BuildArena runs on the data folder {data}: stop it, "
                "or choose another folder with --data or BUILDARENA_DATA"
            ) from error
        self._lock = lock
        self._write_run()

    def _start_servers(self) -> dict[str, str]:
        settings, data = self.settings, self.settings.data.absolute()
        database_url, broker_url = settings.database_url, settings.broker_url
        if database_url is None:
            postgres = EmbeddedPostgres(data / "postgres", self.logs / "postgres.log")
            self._launch_server(postgres)
            database_url = postgres.url
        if broker_url is None:
            valkey = EmbeddedValkey(data / "valkey", self.logs / "valkey.log")
            self._launch_server(valkey)
            broker_url = valkey.url
        return {
            **ALLOCATOR,
            **_without_files(os.environ),
            **{
                f"BUILDARENA_{name.upper()}": (
                    json.dumps(value) if isinstance(value, dict) else str(value)
                )
                for name, value in settings.model_dump(
                    mode="json", exclude_none=True, exclude=set(KEYS)
                ).items()
            },
            **self._key_environment(data),
            "BUILDARENA_DATA": str(data),
            "BUILDARENA_DATABASE_URL": database_url,
            "BUILDARENA_BROKER_URL": broker_url,
            "PYTHONUNBUFFERED": "1",
        }

    def _key_environment(self, data: Path) -> dict[str, str]:
        """Return the variables of the operator's key, which is set or stored in the folder."""
        if not self.settings.require_keys:
            return {}
        if self.settings.admin_key is not None:
            self.admin_key = self.settings.admin_key.get_secret_value()
        else:
            file = data / "admin.key"
            self.admin_key = secret_in(file, new_secret() + "\n").strip()
            self._report(f"the operator's key is in {file}")
        service_keys = {
            f"{PREFIX}{name.upper()}": key.get_secret_value()
            for name in KEYS
            if (key := getattr(self.settings, name)) is not None
        }
        return {**service_keys, "BUILDARENA_ADMIN_KEY": self.admin_key}

    def _launch_server(self, server: EmbeddedPostgres | EmbeddedValkey) -> None:
        self._report(f"starting {server.name}")
        self.supervisor.launch(
            ManagedProcess(name=server.name, start=server.start, stop=server.stop)
        )

    def _launch_program(
        self, name: str, module: Sequence[str], environment: dict[str, str]
    ) -> None:
        log_file = self.logs / f"{log_name(name)}.log"

        def start() -> subprocess.Popen[bytes]:
            with log_file.open("ab") as log:
                return subprocess.Popen(
                    [sys.executable, "-m", *module],
                    env={**environment, PARENT: str(os.getpid())},
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )

        self.supervisor.launch(ManagedProcess(name=name, start=start))

    def _wait_until_healthy(self) -> None:
        self._report("waiting until everything answers")
        deadline = time.monotonic() + READY_WITHIN_S
        missing = "the API"
        with httpx2.Client(base_url=self.url, timeout=5, trust_env=False) as http:
            while time.monotonic() < deadline:
                self.require_running()
                with contextlib.suppress(httpx2.TransportError, ValueError):
                    health = http.get(HEALTH).json()
                    served = {f"simulate.{engine}" for engine in self._simulators}
                    failed = [
                        check["name"]
                        for check in health["checks"]
                        if not check["ok"] and _concerns(check["name"], served)
                    ]
                    if not failed:
                        return
                    missing = ", ".join(failed)
                time.sleep(0.1)
        raise CommandError(
            f"not ready within {READY_WITHIN_S:.0f} s, missing: {missing} (see {self.logs})"
        )

    def _write_run(self) -> None:
        run = Run(
            url=self.url,
            pid=os.getpid(),
            ready=self._ready,
            processes={
                managed.name: managed.process.pid
                for managed in tuple(self.supervisor.managed)
                if managed.process is not None
            },
            stop_grace_s=self.settings.stop_grace_s,
        )
        target = self.settings.data.absolute() / RUN
        partial = target.with_suffix(".partial")
        with self._writing:
            partial.write_text(json.dumps(asdict(run)))
            partial.replace(target)


def _without_files(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment without files of secrets, whose content the processes get."""
    files = {f"{PREFIX}{name.upper()}{SUFFIX}" for name in SECRETS}
    return {name: value for name, value in environment.items() if name not in files}


def _locked(lock: IO[str]) -> None:
    """Take the lock, which a process that only checks it may hold for a moment."""
    for _ in range(LOCK_ATTEMPTS - 1):
        with contextlib.suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        time.sleep(LOCK_AGAIN_S)
    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _concerns(check: str, served: set[str]) -> bool:
    """Return whether a check concerns a part of this stack; it may not run every simulator."""
    if check.startswith("workers of simulate."):
        return check.removeprefix("workers of ") in served
    return check in {"database", "broker", "artifacts", f"workers of {CONSTRUCT_QUEUE}"}


def _require_free_port(host: str, port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise CommandError(
                f"{host}:{port} can't be used for the API ({error.strerror}): "
                "choose another port with --port or BUILDARENA_PORT"
            ) from error
