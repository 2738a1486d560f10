"""Prometheus itself reads a service with our configuration, and evaluates every rule and panel."""

import json
from collections.abc import Iterator

import pytest
from pydantic import SecretStr
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import live_api
from support.servers.prometheus import MONITORING, needs_prometheus, prometheus, target_says
from support.servers.stacks import wait_until

from buildarena_pipeline.runtime.context import Context, open_context

KEY = "a-key-for-prometheus-alone"

pytestmark = needs_prometheus


@pytest.fixture
def api(context: Context) -> Iterator[str]:
    """A service that asks for keys, and has one for metrics."""
    settings = {**WITH_KEYS, "metrics_key": SecretStr(KEY)}
    own = open_context(context.settings.model_copy(update=settings))
    with live_api(own) as url:
        yield url
    own.close()


@pytest.mark.ci
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


@pytest.mark.ci
def test_prometheus_without_the_key_is_refused(api, tmp_path) -> None:
    with prometheus(tmp_path, api, "no-such-key-anywhere") as client:
        target_says(client, "401")
