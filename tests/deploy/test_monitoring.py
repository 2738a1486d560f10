"""Alert rules, their runbook and the dashboards: of metrics that there are, and they arrive."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import yaml
from pydantic import SecretStr
from support.clients.tenants import WITH_KEYS
from support.servers.live_api import live_api
from support.servers.prometheus import (
    MONITORING,
    needs_prometheus,
    needs_promtool,
    prometheus,
    promtool,
    target_says,
)

from buildarena_api.routes import health

RUNBOOK = Path(__file__).resolve().parents[2] / "docs" / "runbook.md"
PARTS = ("Means", "Look", "Do")


def entries() -> dict[str, str]:
    """The runbook's entries by alert."""
    parts = re.split(r"^## (\S+)\n", RUNBOOK.read_text(), flags=re.MULTILINE)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def entry(alert: str) -> dict[str, str]:
    """An entry's parts by name."""
    parts = re.split(rf"^\*\*({'|'.join(PARTS)})\*\*: ", entries()[alert], flags=re.MULTILINE)[1:]
    assert tuple(parts[::2]) == PARTS, alert
    return dict(zip(parts[::2], parts[1::2], strict=True))


BOARDS = sorted((MONITORING / "grafana" / "dashboards").glob("*.json"))
RULES = yaml.safe_load((MONITORING / "prometheus/alerts.yml").read_text())["groups"][0]["rules"]
SUFFIXES = {"histogram": ("_bucket", "_count", "_sum"), "counter": ("",), "gauge": ("",)}
KEY = "a-key-for-prometheus-alone"


def panels() -> Iterator[tuple[str, dict]]:
    for path in BOARDS:
        for panel in json.loads(path.read_text())["panels"]:
            yield path.stem, panel


def expressions() -> list[str]:
    """Every expression that is asked."""
    asked = [target["expr"] for _, panel in panels() for target in panel["targets"]]
    return [rule["expr"] for rule in RULES] + asked


def test_each_metric_that_is_asked_for_is_exposed(context) -> None:
    with live_api(context) as url:
        text = httpx.get(f"{url}/v1/metrics").text
    types = re.findall(r"^# TYPE (\S+) (\S+)$", text, re.MULTILINE)
    names = {name + suffix for name, kind in types for suffix in SUFFIXES[kind]}
    found = re.compile(r"\b(?:buildarena|process|python)_[a-z0-9_]+\b")
    asked = {name for each in expressions() for name in found.findall(each)}
    assert len(asked) > 20
    assert asked <= names


def test_each_alert_is_tried_and_has_an_entry_in_the_runbook() -> None:
    names = {rule["alert"] for rule in RULES}
    for rule in RULES:
        assert rule["labels"]["severity"] in {"critical", "warning", "info", "none"}, rule
        assert rule["annotations"]["summary"], rule
        anchor = rule["annotations"]["runbook_url"]
        assert anchor == f"{{{{ $externalLabels.runbook }}}}#{rule['alert'].lower()}"
        assert "for" in rule
        assert all(entry(rule["alert"]).values())
    assert set(entries()) == names
    tried = yaml.safe_load((MONITORING / "prometheus" / "alerts_test.yml").read_text())["tests"]
    fires, quiet = set(), set()
    for one in (one for test in tried for one in test["alert_rule_test"]):
        (fires if one.get("exp_alerts") else quiet).add(one["alertname"])
    # The watchdog is never quiet.
    assert fires == quiet | {"BuildArenaWatchdog"} == names


@pytest.mark.ci
@needs_promtool
def test_rules_and_configuration_are_prometheus_own() -> None:
    promtool("check", "config", "--syntax-only", str(MONITORING / "prometheus" / "prometheus.yml"))
    promtool("test", "rules", str(MONITORING / "prometheus" / "alerts_test.yml"))


@needs_promtool
def test_each_expression_parses(tmp_path) -> None:
    rules = [{"record": f"panel:{n}", "expr": expr} for n, expr in enumerate(expressions())]
    file = tmp_path / "panels.yml"
    file.write_text(yaml.safe_dump({"groups": [{"name": "panels", "rules": rules}]}))
    assert f"{len(rules)} rules found" in promtool("check", "rules", str(file))


def test_health_calls_wrong_what_alerts_call_wrong() -> None:
    said = {rule["alert"]: rule["expr"] for rule in RULES}
    for alert, limit in {
        "BuildArenaQueueOld": f"> {health.LONG_WAIT_S:.0f}",
        "BuildArenaWorkersLost": f"> {health.FEW_LOST}",
        "BuildArenaDiskLow": f"< {health.LOW_DISK_SHARE}",
        "BuildArenaDiskFull": f"< {health.LOW_DISK_BYTES / 1e9:.0f}e9",
        "BuildArenaClockWrong": f"> {health.CLOCK_TOLERANCE_S:.0f}",
    }.items():
        assert said[alert].endswith(limit), alert


@pytest.mark.ci
@needs_prometheus
def test_prometheus_reads_the_service_with_its_key_and_never_without(context, tmp_path) -> None:
    with live_api(context, **WITH_KEYS, metrics_key=SecretStr(KEY)) as url:
        with prometheus(tmp_path, url, KEY, every_s=1) as client:
            target_says(client, "up")
            up = client.get("/query", params={"query": "buildarena_artifact_store_up"})
            assert [each["value"][1] for each in up.json()["data"]["result"]] == ["1"]
        with prometheus(tmp_path, url, "no-such-key-anywhere", every_s=1) as client:
            target_says(client, "401")
