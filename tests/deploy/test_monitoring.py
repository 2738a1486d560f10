"""Alert rules, their runbook and the dashboards: of metrics that there are, and they arrive."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import yaml
from pydantic import SecretStr
from support.clients.commands import run_cli
from support.clients.tenants import WITH_KEYS
from support.documents.promtool import needs_promtool, promtool
from support.documents.runbook import RUNBOOK, entries, entry
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

ROOT = Path(__file__).resolve().parents[2]
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
def test_each_expression_parses_and_one_that_is_broken_is_found(tmp_path) -> None:
    rules = [{"record": f"panel:{n}", "expr": expr} for n, expr in enumerate(expressions())]
    file = tmp_path / "panels.yml"
    file.write_text(yaml.safe_dump({"groups": [{"name": "panels", "rules": rules}]}))
    assert f"{len(rules)} rules found" in promtool("check", "rules", str(file))
    file.write_text(file.read_text().replace(")", "", 1))
    with pytest.raises(AssertionError, match="could not parse"):
        promtool("check", "rules", str(file))


def test_dashboards_read_the_source_that_there_is() -> None:
    source = MONITORING / "grafana" / "provisioning" / "datasources" / "prometheus.yaml"
    (known,) = yaml.safe_load(source.read_text())["datasources"]
    seen = set()
    for board, panel in panels():
        assert (board, panel["id"]) not in seen
        seen.add((board, panel["id"]))
        assert {target["datasource"]["uid"] for target in panel["targets"]} <= {known["uid"]}
    assert {board for board, _ in seen} == {"api", "models", "overview", "queues"}


def test_the_collectors_pipelines_use_what_it_has() -> None:
    base = yaml.safe_load((MONITORING / "collector.yaml").read_text())
    more = yaml.safe_load((MONITORING / "collector-store.yaml").read_text())
    base["exporters"] |= more["exporters"]
    for part in (base, more):
        for pipeline in part["service"]["pipelines"].values():
            for kind, names in pipeline.items():
                assert set(names) <= set(base[kind])
    assert set(base["service"]["extensions"]) <= set(base["extensions"])
    assert base["receivers"]["otlp"]["protocols"]["http"]["endpoint"].endswith(":4318")


def test_compose_mounts_what_is_here_and_gives_prometheus_its_key() -> None:
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    mounts = {
        name: dict(volume.split(":")[:2] for volume in services[name]["volumes"])
        for name in ("prometheus", "alertmanager", "grafana", "collector")
    }
    here = [path for found in mounts.values() for path in found if path.startswith("./")]
    assert here
    assert [path for path in here if not (ROOT / path).exists()] == []
    folder = mounts["prometheus"]["./deploy/monitoring/prometheus"]
    assert f"--config.file={folder}/prometheus.yml" in services["prometheus"]["command"]
    config = yaml.safe_load((MONITORING / "prometheus" / "prometheus.yml").read_text())
    (job,) = config["scrape_configs"]
    (manager,) = config["alerting"]["alertmanagers"]
    assert manager["static_configs"] == [{"targets": ["alertmanager:9093"]}]
    runbook = config["global"]["external_labels"]["runbook"]
    expanded = set(re.findall(r"\$\{(\w+)\}", runbook))
    assert expanded == set(services["prometheus"]["environment"])
    assert set(job["dns_sd_configs"][0]["names"]) <= set(services)
    secret = Path(job["authorization"]["credentials_file"])
    assert services["api"]["environment"]["BUILDARENA_METRICS_KEY_FILE"] == str(secret)
    assert all(secret.name in services[name]["secrets"] for name in ("api", "prometheus"))


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


def test_our_routes_and_one_file_of_receivers_are_a_whole() -> None:
    """What the container puts together, as the files come and as make-secrets.sh leaves them."""
    folder = MONITORING / "alertmanager"
    whole = "".join((folder / name).read_text() for name in ("alertmanager.yml", "receivers.yml"))
    config = yaml.safe_load(whole)
    routes = [config["route"], *config["route"]["routes"]]
    assert {r["receiver"] for r in routes} == {each["name"] for each in config["receivers"]}
    assert set(re.findall(r"BuildArena\w+", whole)) <= {each["alert"] for each in RULES}
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    (script,) = services["alertmanager"]["command"]
    assert "cat /etc/alertmanager/alertmanager.yml /run/secrets/receivers" in script
    assert services["alertmanager"]["secrets"] == ["receivers"]


def test_the_runbooks_page_is_the_runbook() -> None:
    """The proxy puts the document into its page as it is."""
    assert "{{" not in RUNBOOK.read_text()
    page = (ROOT / "deploy/caddy/runbook.html").read_text()
    assert '{{ markdown (include "runbook.md") }}' in page
    recipe = (ROOT / "deploy/docker/Dockerfile").read_text()
    assert "COPY deploy/caddy/runbook.html docs/runbook.md /srv/" in recipe


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
