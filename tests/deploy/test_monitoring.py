"""Alert rules, their runbook and the dashboards: well formed, and of metrics that there are."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
import yaml
from support.documents.promtool import needs_promtool, promtool
from support.documents.runbook import PARTS, RUNBOOK, entries, entry
from support.servers.live_api import live_api

from buildarena_api.routes import health

ROOT = Path(__file__).resolve().parents[2]
MONITORING = ROOT / "deploy" / "monitoring"
DASHBOARDS = sorted((MONITORING / "grafana" / "dashboards").glob("*.json"))
RULES = yaml.safe_load((MONITORING / "prometheus" / "alerts.yml").read_text())["groups"][0]["rules"]
NAME = re.compile(r"\b(?:buildarena|process|python)_[a-z0-9_]+\b")
SUFFIXES = {"histogram": ("_bucket", "_count", "_sum"), "counter": ("",), "gauge": ("",)}


def read(path: Path) -> dict:
    return json.loads(path.read_text())


def expressions() -> Iterator[tuple[str, str]]:
    """Every expression with where it stands."""
    for rule in RULES:
        yield rule["alert"], rule["expr"]
    for path in DASHBOARDS:
        for panel in read(path)["panels"]:
            for target in panel["targets"]:
                yield f"{path.stem}: {panel['title']}", target["expr"]


def exposed(text: str) -> set[str]:
    """Names of all series that a page of metrics can have."""
    return {
        name + suffix
        for name, kind in re.findall(r"^# TYPE (\S+) (\S+)$", text, re.MULTILINE)
        for suffix in SUFFIXES[kind]
    }


def test_each_metric_that_is_asked_for_is_exposed(context) -> None:
    with live_api(context) as url:
        names = exposed(httpx.get(f"{url}/v1/metrics").text)
    asked = {(where, name) for where, expr in expressions() for name in NAME.findall(expr)}
    assert len(asked) > 40
    assert {(where, name) for where, name in asked if name not in names} == set()


def test_each_alert_says_how_bad_it_is_and_where_its_entry_is() -> None:
    for rule in RULES:
        assert rule["labels"]["severity"] in {"critical", "warning", "info", "none"}, rule
        assert rule["annotations"]["summary"]
        anchor = rule["annotations"]["runbook_url"]
        assert anchor == f"{{{{ $externalLabels.runbook }}}}#{rule['alert'].lower()}"
        assert "for" in rule


def test_each_alert_has_an_entry_and_each_entry_an_alert() -> None:
    found = entries()
    assert set(found) == {rule["alert"] for rule in RULES}
    for alert in found:
        assert set(entry(alert)) == set(PARTS)
    anchors = {name.lower() for name in found}
    assert set(re.findall(r"\(#([a-z]+)\)", RUNBOOK.read_text())) <= anchors


def test_each_alert_is_tried_before_and_while_it_fires() -> None:
    tried = yaml.safe_load((MONITORING / "prometheus" / "alerts_test.yml").read_text())["tests"]
    fires, quiet = set(), set()
    for test in tried:
        for one in test["alert_rule_test"]:
            (fires if one.get("exp_alerts") else quiet).add(one["alertname"])
    # The watchdog is never quiet.
    assert fires == quiet | {"BuildArenaWatchdog"} == {rule["alert"] for rule in RULES}


@pytest.mark.ci
@needs_promtool
def test_rules_and_configuration_are_prometheus_own() -> None:
    promtool("check", "rules", str(MONITORING / "prometheus" / "alerts.yml"))
    promtool("check", "config", "--syntax-only", str(MONITORING / "prometheus" / "prometheus.yml"))
    promtool("test", "rules", str(MONITORING / "prometheus" / "alerts_test.yml"))


@needs_promtool
def test_each_panels_expression_parses(tmp_path) -> None:
    rules = [
        {"record": f"panel:{number}", "expr": expr}
        for number, (_, expr) in enumerate(expressions())
    ]
    file = tmp_path / "panels.yml"
    file.write_text(yaml.safe_dump({"groups": [{"name": "panels", "rules": rules}]}))
    assert f"{len(rules)} rules found" in promtool("check", "rules", str(file))


@needs_promtool
def test_an_expression_that_does_not_parse_is_found(tmp_path) -> None:
    file = tmp_path / "broken.yml"
    rule = {"record": "x:y", "expr": "sum by (queue (buildarena_queue_jobs)"}
    file.write_text(yaml.safe_dump({"groups": [{"name": "x", "rules": [rule]}]}))
    with pytest.raises(AssertionError, match="could not parse"):
        promtool("check", "rules", str(file))


def test_dashboards_are_whole(subtests) -> None:
    for path in DASHBOARDS:
        with subtests.test(path=path):
            board = read(path)
            assert board["uid"] == f"buildarena-{path.stem}"
            source = MONITORING / "grafana" / "provisioning" / "datasources" / "prometheus.yaml"
            (known,) = yaml.safe_load(source.read_text())["datasources"]
            ids = [panel["id"] for panel in board["panels"]]
            assert len(set(ids)) == len(ids)
            taken: set[tuple[int, int]] = set()
            for panel in board["panels"]:
                at = panel["gridPos"]
                cells = {
                    (x, y)
                    for x in range(at["x"], at["x"] + at["w"])
                    for y in range(at["y"], at["y"] + at["h"])
                }
                assert not cells & taken
                assert at["x"] + at["w"] <= 24
                taken |= cells
                assert panel["title"]
                for target in panel["targets"]:
                    assert target["datasource"]["uid"] == known["uid"]


def test_there_is_a_dashboard_for_each_part() -> None:
    assert [path.stem for path in DASHBOARDS] == ["api", "models", "overview", "queues"]


def test_the_collectors_pipelines_use_what_it_has() -> None:
    base = yaml.safe_load((MONITORING / "collector.yaml").read_text())
    more = yaml.safe_load((MONITORING / "collector-store.yaml").read_text())
    base["exporters"] |= more["exporters"]
    pipelines = [
        *base["service"]["pipelines"].values(),
        *more["service"]["pipelines"].values(),
    ]
    for pipeline in pipelines:
        for kind, names in pipeline.items():
            assert set(names) <= set(base[kind])
    assert set(base["service"]["extensions"]) <= set(base["extensions"])
    assert base["receivers"]["otlp"]["protocols"]["http"]["endpoint"].endswith(":4318")


def test_compose_mounts_what_is_here() -> None:
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
    (provider,) = yaml.safe_load(
        (MONITORING / "grafana/provisioning/dashboards/buildarena.yaml").read_text()
    )["providers"]
    dashboards = mounts["grafana"]["./deploy/monitoring/grafana/dashboards"]
    assert provider["options"]["path"] == dashboards
    config = yaml.safe_load((MONITORING / "prometheus" / "prometheus.yml").read_text())
    (job,) = config["scrape_configs"]
    (manager,) = config["alerting"]["alertmanagers"]
    assert manager["static_configs"] == [{"targets": ["alertmanager:9093"]}]
    runbook = config["global"]["external_labels"]["runbook"]
    expanded = set(re.findall(r"\$\{(\w+)\}", runbook))
    assert runbook.endswith("/runbook")
    assert expanded == set(services["prometheus"]["environment"])
    (found,) = job["dns_sd_configs"]
    assert set(found["names"]) <= set(services)
    secret = Path(job["authorization"]["credentials_file"])
    assert secret.parent == Path("/run/secrets")
    assert secret.name in services["prometheus"]["secrets"]
    api = services["api"]
    assert api["environment"]["BUILDARENA_METRICS_KEY_FILE"] == str(secret)
    assert secret.name in api["secrets"]


def rule(alert: str) -> str:
    (expression,) = [each["expr"] for each in RULES if each["alert"] == alert]
    return str(expression)


def test_health_calls_wrong_what_alerts_call_wrong() -> None:
    for alert, limit in {
        "BuildArenaQueueOld": f"> {health.LONG_WAIT_S:.0f}",
        "BuildArenaWorkersLost": f"> {health.FEW_LOST}",
        "BuildArenaDiskLow": f"< {health.LOW_DISK_SHARE}",
        "BuildArenaDiskFull": f"< {health.LOW_DISK_BYTES / 1e9:.0f}e9",
        "BuildArenaClockWrong": f"> {health.CLOCK_TOLERANCE_S:.0f}",
    }.items():
        assert rule(alert).endswith(limit), alert


def test_our_routes_and_one_file_of_receivers_are_a_whole() -> None:
    """What the container puts together, as the files come and as make-secrets.sh leaves them."""
    folder = MONITORING / "alertmanager"
    whole = "".join((folder / name).read_text() for name in ("alertmanager.yml", "receivers.yml"))
    config = yaml.safe_load(whole)
    named = {each["name"] for each in config["receivers"]}
    routes = [config["route"], *config["route"]["routes"]]
    assert {route["receiver"] for route in routes} == named
    known = {each["alert"] for each in RULES}
    spoken = set(re.findall(r"BuildArena\w+", (folder / "alertmanager.yml").read_text()))
    assert spoken <= known
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    (script,) = services["alertmanager"]["command"]
    assert "cat /etc/alertmanager/alertmanager.yml /run/secrets/receivers" in script
    assert services["alertmanager"]["secrets"] == ["receivers"]
    script = (ROOT / "deploy/docker/make-secrets.sh").read_text()
    assert "| keep receivers" in script


def test_the_runbooks_page_needs_nothing_of_templates() -> None:
    """The proxy puts the document into its page as it is."""
    assert "{{" not in RUNBOOK.read_text()
    assert (
        '{{ markdown (include "runbook.md") }}' in (ROOT / "deploy/caddy/runbook.html").read_text()
    )
    assert (
        "COPY deploy/caddy/runbook.html docs/runbook.md /srv/"
        in (ROOT / "deploy/docker/Dockerfile").read_text()
    )
    assert "!docs/runbook.md" in (ROOT / ".dockerignore").read_text().splitlines()
