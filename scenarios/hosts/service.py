"""A whole service, each of whose programs runs on a host of its own."""

import logging
import os
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Self
from unittest.mock import patch

import boto3
import httpx
from moto.server import ThreadedMotoServer
from scenarios.hosts.network import NETWORK, PLACE, address, inside, named
from support.clients.tenants import ADMIN
from support.providers.stand_in import ProviderStandIn
from support.servers.stacks import wait_until

from buildarena_cli.local import EmbeddedPostgres, EmbeddedValkey
from buildarena_cli.local import postgres as embedded_postgres
from buildarena_store import Database

ENGINE = "mujoco"
API_PORT, S3_PORT = 8321, 9000
API = f"http://{address('api')}:{API_PORT}"
BUCKET = "arena"
CREDENTIALS = {
    "AWS_ACCESS_KEY_ID": "test",
    "AWS_SECRET_ACCESS_KEY": "test",
    "AWS_REGION": "us-east-1",
    "AWS_DEFAULT_REGION": "us-east-1",
    "AWS_ENDPOINT": f"http://{address('database')}:{S3_PORT}",
    "AWS_ALLOW_HTTP": "true",
}
PROGRAMS = {
    "api": ("buildarena_api",),
    "construct": ("buildarena_worker",),
    "simulator": ("buildarena_simworker", "--simulator", ENGINE),
    "runner": (
        *("buildarena_simworker", "--simulator", ENGINE),
        *("--api", API, "--allow-http", "--at-once", "2"),
    ),
}
"""Programs by host; each logs into a file of its host's name."""
ENDS_WITHIN_S = 30


class Forgetful(list[object]):
    """Keeps nothing of what it is given: minutes of requests are much."""

    def append(self, _: object) -> None:
        """Does nothing."""


class Service:
    """Use as a context manager."""

    def __init__(self, logs: Path) -> None:
        self.logs = logs
        self._stack = ExitStack()
        self._programs: dict[str, subprocess.Popen[bytes]] = {}
        self._environment = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("BUILDARENA", "AWS_"))
        }

    def __enter__(self) -> Self:
        try:
            self._start()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _start(self) -> None:
        with inside("database"):
            database_url, broker_url = self._start_servers()
            self._start_bucket()
            self.database = Database(database_url)
            self._stack.callback(self.database.close)
            self.database.migrate()
        with inside("construct"):
            self.standin = ProviderStandIn("expert", latency_s=0.05)
            self.standin.counts.bodies = Forgetful()  # type: ignore[assignment]
            self._stack.enter_context(self.standin)
        settings = {
            "BUILDARENA_DATABASE_URL": database_url,
            "BUILDARENA_BROKER_URL": broker_url,
            "BUILDARENA_ARTIFACTS_URL": f"s3://{BUCKET}/artifacts",
            "BUILDARENA_MODELS_FILE": str(self._models_file()),
            **CREDENTIALS,
        }
        open_to_others = {
            "BUILDARENA_HOST": address("api"),
            "BUILDARENA_PORT": str(API_PORT),
            "BUILDARENA_REQUIRE_KEYS": "true",
            "BUILDARENA_ADMIN_KEY": ADMIN,
            "BUILDARENA_RATE_LIMIT": "1000000/minute",
        }
        self._program("api", {**settings, **open_to_others})
        self.client = self._stack.enter_context(
            httpx.Client(base_url=API, headers={"Authorization": f"Bearer {ADMIN}"}, timeout=10)
        )
        wait_until(self._answers, 60, "the API answers")
        self._program("construct", settings)
        self._program("simulator", {**settings, "BUILDARENA_SIMULATIONS_PER_WORKER": "1"})
        self._program("runner", {"BUILDARENA_KEY": self._runner_key()})

    def _start_servers(self) -> tuple[str, str]:
        here, logs = address("database"), self.logs
        postgres = EmbeddedPostgres(PLACE / "postgres", logs / "postgres.log")
        postgres.stop(postgres.start())
        with (PLACE / "postgres/cluster/pg_hba.conf").open("a") as rules:
            rules.write(f"host all all {NETWORK}.0/24 scram-sha-256\n")
        with patch.dict(embedded_postgres.SETTINGS, listen_addresses=f"127.0.0.1,{here}"):
            self._stack.callback(postgres.stop, postgres.start())
        with patch("buildarena_cli.local.valkey.LOOPBACK", here):
            valkey = EmbeddedValkey(PLACE / "valkey", logs / "valkey.log")
            self._stack.callback(valkey.stop, valkey.start())
        return postgres.url.replace("@127.0.0.1:", f"@{here}:"), valkey.url

    def _start_bucket(self) -> None:
        logging.getLogger("werkzeug").setLevel(logging.ERROR)  # it would tell of each request
        server = ThreadedMotoServer(address("database"), S3_PORT, verbose=False)
        server.start()
        self._stack.callback(server.stop)
        with patch.dict(os.environ, CREDENTIALS):
            client = boto3.client("s3", endpoint_url=CREDENTIALS["AWS_ENDPOINT"])
            client.create_bucket(Bucket=BUCKET)
            client.close()

    def _models_file(self) -> Path:
        file = PLACE / "models.yaml"
        file.write_text(
            f"providers:\n  standin: {{protocol: openai, base_url: '{self.standin.url}/v1'}}\n"
            "models:\n  - {name: standin/expert, provider: standin, model: expert, "
            "price: {input: 2.0, output: 8.0, cached: 0.5}}\n"
        )
        return file

    def _runner_key(self) -> str:
        payload = {"name": "runner", "scopes": ["runner"], "simulators": [ENGINE]}
        answer = self.client.post("/v1/keys", json=payload)
        assert answer.status_code == 201, answer.text
        return str(answer.json()["secret"])

    def _answers(self) -> bool:
        try:
            return self.client.get("/v1/health").is_success
        except httpx.TransportError:
            return False

    def _program(self, host: str, settings: dict[str, str]) -> None:
        if host != "runner":
            settings = {**settings, "BUILDARENA_DATA": str(PLACE / "data" / host)}
        with inside(host), (self.logs / f"{host}.log").open("ab") as log:
            program = subprocess.Popen(
                [sys.executable, "-m", *PROGRAMS[host]],
                env={**self._environment, **settings, "PYTHONUNBUFFERED": "1"},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                cwd="/",
                preexec_fn=named(host),  # noqa: PLW1509 - two system calls
            )
        self._programs[host] = program
        self._stack.callback(self._stop, program)

    def _stop(self, program: subprocess.Popen[bytes]) -> None:
        program.terminate()
        try:
            program.wait(ENDS_WITHIN_S)
        finally:
            program.kill()
            program.wait()

    def require_running(self) -> None:
        """Checks that no program has ended."""
        ended = {host: p.returncode for host, p in self._programs.items() if p.poll() is not None}
        assert not ended, f"ended, with these exit codes: {ended}"
