"""Prometheus, from Debian's package, with our configuration and our rules."""

import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
import yaml
from support.programs import captured
from support.servers.stacks import wait_until

from buildarena_cli.local.server import free_port

MONITORING = Path(__file__).resolve().parents[3] / "deploy" / "monitoring"
PROMETHEUS = shutil.which("prometheus")
SITE = {"SITE": "arena.example", "HTTPS_PORT": "443", "BASE_PATH": "/lab"}
RUNBOOK = "https://arena.example:443/lab/runbook"

needs_prometheus = pytest.mark.skipif(
    PROMETHEUS is None, reason="it needs Prometheus: install the Debian packages prometheus"
)


@contextmanager
def prometheus(
    folder: Path,
    api: str,
    key: str | None,
    *,
    every_s: int = 3,
) -> Iterator[httpx.Client]:
    """Runs it with our files; only where the API is and how often it is asked are others.

    Args:
        folder: For its files.
        api: Where the API is.
        key: For metrics; None where none is asked for.
        every_s: How often the API is asked.
    """
    own = MONITORING / "prometheus"
    config = yaml.safe_load((own / "prometheus.yml").read_text())
    config["global"] |= dict.fromkeys(("scrape_interval", "scrape_timeout"), f"{every_s}s")
    config["global"]["evaluation_interval"] = "1s"
    config["rule_files"] = [str(own / name) for name in config["rule_files"]]
    config["alerting"]["alertmanagers"] = [{"static_configs": [{"targets": []}]}]
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
    client = httpx.Client(base_url=f"http://127.0.0.1:{port}/api/v1", timeout=20)
    with _running(words, folder / "prometheus.log"), client:
        yield client


@contextmanager
def _running(words: Sequence[str], log: Path) -> Iterator[None]:
    own = {**os.environ, **{f"BUILDARENA_{name}": value for name, value in SITE.items()}}
    with log.open("wb") as out, subprocess.Popen(words, stdout=out, stderr=out, env=own) as process:
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


PROMTOOL = shutil.which("promtool")

needs_promtool = pytest.mark.skipif(
    PROMTOOL is None, reason="rules need promtool: install the Debian packages prometheus"
)


def promtool(*words: str) -> str:
    """What a check printed; a failed one fails the test."""
    done = captured([str(PROMTOOL), *words], within_s=60)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr
