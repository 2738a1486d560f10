"""Alerts that `doctor` reads from Prometheus, and answers that are none of it."""

import json

import pytest
from support.servers.wrong_server import answer, wrong_server

from buildarena_cli.alerts import WATCHDOG, firing_alerts
from buildarena_cli.errors import CommandError


def told(name: str, severity: str, state: str = "firing") -> dict[str, object]:
    return {
        "labels": {"alertname": name, "severity": severity},
        "annotations": {"summary": f"{name}!", "runbook_url": f"https://x/#{name.lower()}"},
        "state": state,
    }


def page(*alerts: dict[str, object]) -> bytes:
    return answer(200, json.dumps({"data": {"alerts": alerts}}).encode())


ALWAYS = told(WATCHDOG, "none")


def test_the_worst_come_first_and_only_those_that_fire() -> None:
    alerts = [
        ALWAYS,
        told("BuildArenaBudgetExhausted", "info"),
        told("BuildArenaFaults", "warning"),
        told("BuildArenaApiSlow", "warning", "pending"),
        told("BuildArenaApiDown", "critical"),
        told("SomebodyElses", "critical"),
    ]
    with wrong_server(page(*alerts)) as server:
        firing = firing_alerts(server.url + "/")
        assert server.lines == ["GET /api/v1/alerts HTTP/1.1"]
    assert [alert.name.removeprefix("BuildArena") for alert in firing] == [
        *("ApiDown", "Faults", "BudgetExhausted")
    ]
    assert firing[0].runbook == "https://x/#buildarenaapidown"


def test_a_prometheus_without_our_rules_is_told() -> None:
    with (
        wrong_server(page(told("BuildArenaApiDown", "critical"))) as server,
        pytest.raises(CommandError, match="BuildArenaWatchdog does not fire"),
    ):
        firing_alerts(server.url)


@pytest.mark.parametrize(
    "said",
    [
        *(b"<html>", b"[]", b"{}", b"null", b'{"data": {"alerts": [{}]}}'),
        b'{"data": {"alerts": 3}}',
    ],
)
def test_what_is_no_prometheus_is_told(said) -> None:
    with (
        wrong_server(answer(200, said)) as server,
        pytest.raises(CommandError, match="is not Prometheus"),
    ):
        firing_alerts(server.url)


@pytest.mark.parametrize("said", [answer(500), answer(401), b"", b"no HTTP"])
def test_a_prometheus_that_can_not_be_asked_is_told(said) -> None:
    with wrong_server(said) as server, pytest.raises(CommandError, match="can't be asked"):
        firing_alerts(server.url)


@pytest.mark.parametrize("url", ["prometheus:9090", "file:///etc/passwd", ""])
def test_only_http_is_asked(url) -> None:
    with pytest.raises(CommandError, match="begins with http"):
        firing_alerts(url)
