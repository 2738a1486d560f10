"""Prometheus and Alertmanager, from Debian's packages, with our configuration and our rules."""

import json
import os
import shutil
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest
import yaml
from support.servers.stacks import wait_until

from buildarena_cli.local.server import free_port

MONITORING = Path(__file__).resolve().parents[3] / "deploy" / "monitoring"
PROMETHEUS = shutil.which("prometheus")
ALERTMANAGER = shutil.which("prometheus-alertmanager")
SITE = {"SITE": "arena.example", "HTTPS_PORT": "443", "BASE_PATH": "/lab"}
RUNBOOK = "https://arena.example:443/lab/runbook"

needs_prometheus = pytest.mark.skipif(
    PROMETHEUS is None, reason="it needs Prometheus: install the Debian packages prometheus"
)
needs_alertmanager = pytest.mark.skipif(
    PROMETHEUS is None or ALERTMANAGER is None,
    reason="it needs the Debian packages prometheus prometheus-alertmanager",
)


@contextmanager
def prometheus(
    folder: Path,
    api: str,
    key: str | None,
    *,
    every_s: int = 3,
    alertmanager: str | None = None,
    waits: bool = True,
) -> Iterator[httpx.Client]:
    """Runs it with our files; only where the API is and how often it is asked are others.

    Args:
        folder: For its files.
        api: Where the API is.
        key: For metrics; None where none is asked for.
        every_s: How often the API is asked.
        alertmanager: Host and port of the one that is told; None for nobody.
        waits: Whether alerts fire as late as their rules say; else at once.
    """
    own = MONITORING / "prometheus"
    config = yaml.safe_load((own / "prometheus.yml").read_text())
    config["global"] |= {
        "scrape_interval": f"{every_s}s",
        "scrape_timeout": f"{every_s}s",
        "evaluation_interval": "1s",
    }
    config["rule_files"] = [str(_rules(own / name, folder, waits)) for name in config["rule_files"]]
    told = [alertmanager] if alertmanager else []
    config["alerting"]["alertmanagers"] = [{"static_configs": [{"targets": told}]}]
    (job,) = config["scrape_configs"]
    del job["dns_sd_configs"]
    job["static_configs"] = [{"targets": [urlsplit(api).netloc]}]
    if key is None:
        del job["authorization"]
    else:
        job["authorization"]["credentials_file"] = str(folder / "metrics_key")
        (folder / "metrics_key").write_text(key)
    (folder / "prometheus.yml").write_text(yaml.safe_dump(config))
    port = free_port()
    words = [
        str(PROMETHEUS),
        f"--config.file={folder / 'prometheus.yml'}",
        f"--storage.tsdb.path={folder / 'data'}",
        f"--web.listen-address=127.0.0.1:{port}",
        # Later versions do so by themselves.
        "--enable-feature=expand-external-labels",
    ]
    with (
        _running(words, folder / "prometheus.log"),
        httpx.Client(base_url=f"http://127.0.0.1:{port}/api/v1", timeout=20) as client,
    ):
        yield client


def _rules(file: Path, folder: Path, waits: bool) -> Path:
    if waits:
        return file
    rules = yaml.safe_load(file.read_text())
    for group in rules["groups"]:
        for rule in group["rules"]:
            rule["for"] = "0s"
    hasty = folder / file.name
    hasty.write_text(yaml.safe_dump(rules))
    return hasty


@dataclass
class Receiver:
    """Who is told alerts.

    Attributes:
        address: Host and port of the Alertmanager that tells them.
        operators: What the operators heard, in turn: alerts with ``status`` and ``labels``.
        watchdog: What the watchdog's service heard.
    """

    address: str = ""
    operators: list[dict[str, Any]] = field(default_factory=list)
    watchdog: list[dict[str, Any]] = field(default_factory=list)

    def heard(self, alert: str, status: str) -> dict[str, Any] | None:
        """The last that was heard of an alert, if it is in this state."""
        own = [each for each in self.operators if each["labels"]["alertname"] == alert]
        return own[-1] if own and own[-1]["status"] == status else None


@contextmanager
def alertmanager(folder: Path) -> Iterator[Receiver]:
    """Runs it with our routes, and one file of receivers that names a server of the test's."""
    receiver = Receiver(address=f"127.0.0.1:{free_port()}")
    with _hooks(receiver) as url:
        ours = yaml.safe_load((MONITORING / "alertmanager" / "alertmanager.yml").read_text())
        (watchdog,) = ours["route"]["routes"]
        for route in (ours["route"], watchdog):
            route |= {"group_wait": "0s", "group_interval": "1s"}
        names = ("operators", "watchdog")
        receivers = [{"name": n, "webhook_configs": [{"url": f"{url}/{n}"}]} for n in names]
        config = folder / "alertmanager.yml"
        config.write_text(yaml.safe_dump(ours) + yaml.safe_dump({"receivers": receivers}))
        words = [
            str(ALERTMANAGER),
            f"--config.file={config}",
            f"--storage.path={folder / 'alerts'}",
            f"--web.listen-address={receiver.address}",
            "--cluster.listen-address=",
        ]
        with _running(words, folder / "alertmanager.log"):
            yield receiver


@contextmanager
def _hooks(receiver: Receiver) -> Iterator[str]:
    class Hook(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            told = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            getattr(receiver, self.path.strip("/")).extend(told["alerts"])
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: object) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), Hook) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


@contextmanager
def _running(words: Sequence[str], log: Path) -> Iterator[None]:
    environment = {**os.environ, **{f"BUILDARENA_{name}": value for name, value in SITE.items()}}
    with (
        log.open("wb") as out,
        subprocess.Popen(words, stdout=out, stderr=out, env=environment) as process,
    ):
        try:
            yield
        finally:
            process.terminate()


def target_says(client: httpx.Client, wanted: str) -> None:
    """Waits until its only target is well, or has an error with some words.

    A busy machine may be too slow for the first times that it asks.
    """

    def says() -> bool:
        try:
            active = client.get("/targets").json()["data"]["activeTargets"]
        except (httpx.TransportError, ValueError):
            return False
        return any(wanted in (each["health"], *each["lastError"].split()) for each in active)

    wait_until(says, 60, f"the target says {wanted}")
