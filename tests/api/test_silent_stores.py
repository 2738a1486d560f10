"""Stores that take connections and say nothing: health and metrics answer all the same."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest
from pydantic import SecretStr
from support.clients.tenants import ADMIN, WITH_KEYS
from support.servers.hushed_proxy import HushedProxy, hushed_proxy
from support.servers.live_api import changed, live_api
from support.servers.stacks import wait_until

from buildarena_api.http.probes import PATIENCE_S, PartFailedError, Probe
from buildarena_pipeline.runtime.settings import Settings

METRICS = "a-secret-for-metrics-alone-of-some-length"
PARTS = {"database": "database_up", "broker": "broker_up", "artifacts": "artifact_store_up"}


@contextmanager
def service_behind(context, part: str, monkeypatch) -> Iterator[tuple[str, HushedProxy]]:
    """The API, with a proxy that can fall silent before one of its stores."""
    settings: Settings = context.settings
    place = {
        "database": settings.required_database_url(),
        "broker": settings.required_broker_url(),
        "artifacts": "http://127.0.0.1:9",
    }[part]
    with hushed_proxy(place) as proxy:
        urls = {
            "database": {"database_url": proxy.url},
            "broker": {"broker_url": proxy.url},
            "artifacts": {"artifacts_url": "s3://bucket"},
        }
        monkeypatch.setenv("AWS_ENDPOINT", proxy.url)
        own = {**WITH_KEYS, "metrics_key": SecretStr(METRICS), **urls[part]}
        with changed(context, **own) as behind, live_api(behind) as url:
            yield url, proxy


def checks(url: str) -> dict[str, dict]:
    return {each["name"]: each for each in httpx.get(f"{url}/v1/health").json()["checks"]}


def ups(url: str) -> dict[str, float]:
    key = {"Authorization": f"Bearer {METRICS}"}
    answer = httpx.get(f"{url}/v1/metrics", headers=key)
    assert answer.status_code == 200, answer.text
    lines = (line for line in answer.text.splitlines() if not line.startswith("#"))
    return {
        name.removeprefix("buildarena_"): float(value)
        for name, _, value in (line.rpartition(" ") for line in lines)
        if name.endswith("_up")
    }


@pytest.mark.ci
@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("part", ["database", "broker"])
def test_a_store_that_falls_silent_is_named_and_holds_nobody_up(context, part, monkeypatch) -> None:
    with service_behind(context, part, monkeypatch) as (url, proxy):
        wait_until(
            lambda: all(each["ok"] for each in list(checks(url).values())[:3]), 20, "all work"
        )
        assert set(ups(url).values()) == {1.0}
        proxy.hush()
        # Requests that need the store, and hang as long as it is silent.
        hanging = [
            threading.Thread(target=_ask_for_jobs, args=(url,), daemon=True) for _ in range(12)
        ]
        for thread in hanging:
            thread.start()
        wait_until(lambda: not checks(url)[part]["ok"], 3 * PATIENCE_S, f"{part} is known to fail")
        begun = time.monotonic()
        for _ in range(20):
            assert next(name for name, check in checks(url).items() if not check["ok"]) == part
            found = ups(url)
            assert [name for name, value in found.items() if not value] == [PARTS[part]]
        # Forty answers, each a connection of its own: none waited for a store.
        assert time.monotonic() - begun < 2 * PATIENCE_S
        proxy.speak()
        wait_until(lambda: checks(url)[part]["ok"], 20, f"{part} is known to work again")
        for thread in hanging:
            thread.join(40)


def _ask_for_jobs(url: str) -> None:
    httpx.get(f"{url}/v1/jobs", headers={"Authorization": f"Bearer {ADMIN}"}, timeout=40)


@pytest.mark.ci
def test_a_bucket_that_was_always_silent_is_named(context, monkeypatch) -> None:
    credentials = ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_REGION")
    for name, value in {**dict.fromkeys(credentials, "test"), "AWS_ALLOW_HTTP": "true"}.items():
        monkeypatch.setenv(name, value)
    with service_behind(context, "artifacts", monkeypatch) as (url, proxy):
        proxy.hush()
        wait_until(lambda: not checks(url)["artifacts"]["ok"], 3 * PATIENCE_S, "it is known")
        assert httpx.get(f"{url}/v1/health").status_code == 200
        assert ups(url)["artifact_store_up"] == 0


def test_a_probe_says_what_was_said_last_and_does_not_wait() -> None:
    now, answers = [0.0], threading.Event()
    answers.set()

    def ask() -> int:
        answers.wait()
        return 7

    probe = Probe("part", ask, clock=lambda: now[0])
    with pytest.raises(PartFailedError, match="has not answered yet"):
        probe.latest()
    probe.start()
    wait_until(lambda: probe.works, 10, "it answered")
    answers.clear()
    probe.renewed()
    wait_until(lambda: probe._begun_at is not None, 10, "it is asked")
    assert probe.latest() == 7
    now[0] += PATIENCE_S + 1
    with pytest.raises(PartFailedError, match="has not answered for 4 s"):
        probe.latest()
    answers.set()
    wait_until(lambda: probe.works, 10, "it answered again")
    probe.end()
    probe.join(10)
