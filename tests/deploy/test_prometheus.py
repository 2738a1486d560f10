"""Prometheus itself reads a service with our configuration, and evaluates every rule and panel."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
import yaml
from pydantic import SecretStr
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import live_api
from support.servers.stacks import wait_until

from buildarena_cli.local import free_port
from buildarena_pipeline.runtime.context import Context, open_context

MONITORING = Path(__file__).resolve().parents[2] / "deploy" / "monitoring"
PROMETHEUS = shutil.which("prometheus")
KEY = "a-key-for-prometheus-alone"

pytestmark = pytest.mark.skipif(
    PROMETHEUS is None, reason="it needs Prometheus: install the Debian packages prometheus"
)


@contextmanager
def prometheus(folder: Path, api: str, key: str) -> Iterator[httpx.Client]:
    """Runs it with our files; only where the API is and how often it is asked are others."""
    own = MONITORING / "prometheus"
    config = yaml.safe_load((own / "prometheus.yml").read_text())
    config["global"] = {
        "scrape_interval": "3s",
        "scrape_timeout": "3s",
        "evaluation_interval": "1s",
    }
    config["rule_files"] = [str(own / name) for name in config["rule_files"]]
    (job,) = config["scrape_configs"]
    del job["dns_sd_configs"]
    job["static_configs"] = [{"targets": [urlsplit(api).netloc]}]
    job["authorization"]["credentials_file"] = str(folder / "metrics_key")
    (folder / "metrics_key").write_text(key)
    (folder / "prometheus.yml").write_text(yaml.safe_dump(config))
    port = free_port()
    words = [
        str(PROMETHEUS),
        f"--config.file={folder / 'prometheus.yml'}",
        f"--storage.tsdb.path={folder / 'data'}",
        f"--web.listen-address=127.0.0.1:{port}",
    ]
    with (
        (folder / "log").open("wb") as log,
        subprocess.Popen(words, stdout=log, stderr=log) as process,
        httpx.Client(base_url=f"http://127.0.0.1:{port}/api/v1", timeout=20) as client,
    ):
        try:
            yield client
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


@pytest.fixture
def api(context: Context) -> Iterator[str]:
    """A service that asks for keys, and has one for metrics."""
    settings = {**WITH_KEYS, "metrics_key": SecretStr(KEY)}
    own = open_context(context.settings.model_copy(update=settings))
    with live_api(own) as url:
        yield url
    own.close()


@pytest.mark.slow
def test_prometheus_reads_the_service_and_understands_every_expression(api, tmp_path) -> None:
    with prometheus(tmp_path, api, KEY) as client:
        target_says(client, "up")

        def evaluated() -> list[dict]:
            (group,) = client.get("/rules").json()["data"]["groups"]
            return [] if any(r["health"] == "unknown" for r in group["rules"]) else group["rules"]

        for rule in wait_until(evaluated, 30, "rules were evaluated"):
            assert rule["health"] == "ok", rule
        for path in (MONITORING / "grafana" / "dashboards").glob("*.json"):
            for panel in json.loads(path.read_text())["panels"]:
                for asked in panel["targets"]:
                    answer = client.get("/query", params={"query": asked["expr"]})
                    assert answer.json()["status"] == "success", (panel["title"], answer.text)
        up = client.get("/query", params={"query": "buildarena_artifact_store_up"})
        assert [each["value"][1] for each in up.json()["data"]["result"]] == ["1"]


@pytest.mark.slow
def test_prometheus_without_the_key_is_refused(api, tmp_path) -> None:
    with prometheus(tmp_path, api, "no-such-key-anywhere") as client:
        target_says(client, "401")
