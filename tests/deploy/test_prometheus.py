"""Prometheus itself reads a service with our configuration, and evaluates every rule and panel."""

from __future__ import annotations

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
from live_api import live_api
from pydantic import SecretStr
from running import wait_until
from tenants import WITH_KEYS

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
    config["global"] = {"scrape_interval": "1s", "evaluation_interval": "1s"}
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
            wait_until(lambda: targets(client), 30, "a target was asked")
            yield client
        finally:
            process.terminate()


def targets(client: httpx.Client) -> list[dict]:
    """What it asked so far."""
    try:
        active = client.get("/targets").json()["data"]["activeTargets"]
    except (httpx.TransportError, ValueError):
        return []
    return [target for target in active if target["health"] != "unknown"]


def test_prometheus_reads_the_service_and_understands_every_expression(
    context: Context, tmp_path: Path
) -> None:
    settings = {**WITH_KEYS, "metrics_key": SecretStr(KEY)}
    own = open_context(context.settings.model_copy(update=settings))
    with live_api(own) as api, prometheus(tmp_path, api, KEY) as client:
        (target,) = targets(client)
        assert (target["health"], target["lastError"]) == ("up", "")

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
    own.close()


def test_prometheus_without_the_key_is_refused(context: Context, tmp_path: Path) -> None:
    own = open_context(context.settings.model_copy(update=WITH_KEYS))
    with live_api(own) as api, prometheus(tmp_path, api, "no-such-key-anywhere") as client:
        (target,) = targets(client)
        assert target["health"] == "down"
        assert "401" in target["lastError"]
    own.close()
