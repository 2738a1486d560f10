"""Alert rules, their runbook and the dashboards: of metrics that there are, and they arrive."""

import json
import re
from collections.abc import Iterator

import httpx
import pytest
import yaml
from pydantic import SecretStr
from support.clients.commands import run_cli
from support.clients.tenants import WITH_KEYS
from support.documents.promtool import needs_promtool, promtool
from support.documents.runbook import entries, entry
from support.servers.live_api import changed, live_api
from support.servers.prometheus import (
    MONITORING,
    Receiver,
    alertmanager,
    needs_alertmanager,
    needs_prometheus,
    prometheus,
    target_says,
)
from support.servers.prometheus import RUNBOOK as RUNBOOK_URL
from support.servers.stacks import hung, kill, running_stack, wait_until, without_store

from buildarena_api.routes import health
from buildarena_cli.local.stack import Stack

BOARDS = sorted((MONITORING / "grafana" / "dashboards").glob("*.json"))
RULES = yaml.safe_load((MONITORING / "prometheus/alerts.yml").read_text())["groups"][0]["rules"]
SUFFIXES = {"histogram": ("_bucket", "_count", "_sum"), "counter": ("",), "gauge": ("",)}
KEY = "a-key-for-prometheus-alone"
WITHIN_S = 60.0


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
def test_prometheus_reads_the_service_with_its_key_and_without_it_nothing(
    context, tmp_path
) -> None:
    keys = {**WITH_KEYS, "metrics_key": SecretStr(KEY)}
    with changed(context, **keys) as own, live_api(own) as url:
        with prometheus(tmp_path, url, KEY, every_s=1) as client:
            target_says(client, "up")
            up = client.get("/query", params={"query": "buildarena_artifact_store_up"})
            assert [each["value"][1] for each in up.json()["data"]["result"]] == ["1"]
        with prometheus(tmp_path, url, "no-such-key-anywhere", every_s=1) as client:
            target_says(client, "401")


@pytest.fixture(scope="module")
def served(tmp_path_factory) -> Iterator[tuple[Stack, Receiver]]:
    """A service, and whoever is told its alerts."""
    folder = tmp_path_factory.mktemp("alerts")
    with (
        running_stack(folder, simulators=()) as stack,
        alertmanager(folder) as receiver,
        prometheus(
            folder, stack.url, None, every_s=1, alertmanager=receiver.address, waits=False
        ) as client,
    ):
        target_says(client, "up")
        wait_until(lambda: receiver.watchdog, WITHIN_S, "the watchdog is heard")
        yield stack, receiver


@pytest.mark.nightly
@needs_alertmanager
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("alert", "part", "doctor"),
    [
        ("BuildArenaDatabaseDown", "postgres", "!! +database +has not answered for"),
        ("BuildArenaBrokerDown", "valkey", "!! +broker "),
        ("BuildArenaApiDown", "api", None),
        ("BuildArenaArtifactStoreDown", None, "!! +artifacts "),
    ],
)
def test_a_fault_is_heard_of_seen_by_the_doctor_and_over(served, alert, part, doctor) -> None:
    stack, receiver = served
    with without_store(stack) if part is None else hung(stack, part):
        told = wait_until(lambda: receiver.heard(alert, "firing"), WITHIN_S, f"{alert} is heard")
        assert told["annotations"]["runbook_url"] == f"{RUNBOOK_URL}#{alert.lower()}"
        assert told["annotations"]["summary"]
        if doctor is not None:
            assert re.search(doctor, run_cli(stack.url, "doctor").stdout)
        if part is not None:
            kill(stack, part)
    wait_until(lambda: receiver.heard(alert, "resolved"), WITHIN_S, f"{alert} is over")
