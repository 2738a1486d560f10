"""What Prometheus' alerts say at this moment."""

from __future__ import annotations

import json
from dataclasses import dataclass
from http.client import HTTPException
from typing import Any, Final
from urllib.request import urlopen

from buildarena_cli.errors import CommandError

WATCHDOG: Final = "BuildArenaWatchdog"
"""Always fires; where it does not, Prometheus does not evaluate our rules."""
OURS: Final = "BuildArena"
TIMEOUT_S: Final = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Alert:
    """An alert that fires.

    Attributes:
        name: Of the rule.
        severity: ``critical``, ``warning`` or ``info``.
        summary: What is wrong, for people.
        runbook: Where it says what to do.
    """

    name: str
    severity: str
    summary: str
    runbook: str


def firing_alerts(url: str) -> list[Alert]:
    """The alerts of ours that fire, the worst first.

    Args:
        url: Where Prometheus is, for example ``http://prometheus:9090``.

    Raises:
        CommandError: Prometheus can't be asked, or does not evaluate our rules.
    """
    if not url.startswith(("http://", "https://")):
        raise CommandError(
            f"{url!r} is no address of Prometheus: it begins with http:// or https://"
        )
    url = url.rstrip("/")
    try:
        with urlopen(f"{url}/api/v1/alerts", timeout=TIMEOUT_S) as answer:  # noqa: S310 - checked
            document = json.load(answer)
        listed = document["data"]["alerts"]
        alerts = [_alert(each) for each in listed if each["state"] == "firing"]
    except (OSError, HTTPException) as error:
        raise CommandError(f"Prometheus at {url} can't be asked: {error}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise CommandError(f"what answers at {url} is not Prometheus") from error
    if all(alert.name != WATCHDOG for alert in alerts):
        raise CommandError(
            f"{WATCHDOG} does not fire at {url}: that Prometheus does not evaluate "
            "deploy/monitoring/prometheus/alerts.yml"
        )
    grades = ("critical", "warning", "info")
    ours = (each for each in alerts if each.severity in grades and each.name.startswith(OURS))
    return sorted(ours, key=lambda each: (grades.index(each.severity), each.name, each.summary))


def _alert(document: dict[str, Any]) -> Alert:
    labels, annotations = document["labels"], document["annotations"]
    return Alert(
        name=labels["alertname"],
        severity=labels.get("severity", ""),
        summary=annotations.get("summary", ""),
        runbook=annotations.get("runbook_url", ""),
    )
