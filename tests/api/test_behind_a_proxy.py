"""The service behind a reverse proxy: below a path, under an outer name, and over slow pieces."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest
from pydantic import ValidationError
from support.servers.live_api import live_api
from support.servers.reverse_proxy import ProxyRules, reverse_proxy
from typer.testing import CliRunner

from buildarena_api.dashboard import BASE_NAME, first_page
from buildarena_backend.errors import StartupError
from buildarena_backend.process.context import Context
from buildarena_backend.settings import OWN_PATHS, Settings, load_settings
from buildarena_cli.main import app

BASE = "/tools/arena"
PROXIES = "127.0.0.0/8"
SWEEP = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0]}


@contextmanager
def served(context: Context, rules: ProxyRules, **settings: object) -> Iterator[str]:
    """The address of a service through a proxy."""
    with live_api(context, **settings) as inner, reverse_proxy(inner, rules) as url:
        yield url


@pytest.mark.parametrize("cuts", [True, False], ids=["cut off", "passed on"])
def test_everything_works_below_a_path(context, cuts) -> None:
    """By a proxy that cuts the path off and by one that does not."""
    proxied = served(context, ProxyRules(prefix=BASE, cuts=cuts), base_path=BASE)
    with proxied as below, httpx.Client(timeout=20) as client:
        made = client.post(f"{below}/v1/sweeps", json=SWEEP)
        sweep = made.json()["id"]
        assert made.headers["Location"] == f"{BASE}/v1/sweeps/{sweep}"
        assert client.get(httpx.URL(below).join(made.headers["Location"])).json()["id"] == sweep
        assert client.delete(f"{below}/v1/sweeps").status_code == 405
        assert client.get(f"{below}/v1/nothing").status_code == 404
        contract = client.get(f"{below}/openapi.json").json()
        assert contract["servers"] == [{"url": BASE}]
        script = f"{BASE}/static-offline-docs/swagger-ui-bundle.js"
        assert script in client.get(f"{below}/docs").text
        assert client.get(httpx.URL(below).join(script)).status_code == 200
        # A proxy that is told nothing may keep events back; ours would show that they come late.
        with client.stream("GET", f"{below}/v1/sweeps/{sweep}/events") as stream:
            assert stream.headers["X-Accel-Buffering"] == "no"
            assert "no-" in stream.headers["Cache-Control"]
            lines = stream.iter_lines()
            seen = next(line for line in lines if line.startswith("data:"))
            assert json.loads(seen.removeprefix("data:"))
            client.post(f"{below}/v1/sweeps/{sweep}/pause").raise_for_status()
            asked = time.monotonic()
            assert next(line for line in lines if "paused" in line)
            assert time.monotonic() - asked < 10
        for words in (["model", "list"], ["job", "submit", "lift-1", "builtin/idle"]):
            done = CliRunner().invoke(app, [*words, "--url", f"{below}/"])
            assert done.exit_code == 0, (words, done.output)
        if not cuts:
            assert client.get(below).content == client.get(f"{below}/").content
            rebound = client.get(below, headers={"Host": "rebound.example"})
            assert rebound.status_code == 421


def test_a_service_with_a_base_path_still_answers_at_its_root(context) -> None:
    """As probes ask, who know of no proxy."""
    with served(context, ProxyRules(), base_path=BASE) as url:
        for path, status in (("", 200), (BASE, 200), (f"{BASE}x", 404), (f"{BASE}{BASE}", 404)):
            assert httpx.get(f"{url}{path}/v1/health").status_code == status, path


def test_the_first_page_names_its_files_below_the_path(tmp_path) -> None:
    (tmp_path / "index.html").write_text(
        '<html><head><script src="/assets/a.js"></script><a href="//elsewhere">x</a></head></html>'
    )
    text = first_page(tmp_path, BASE)
    for said in (f'src="{BASE}/assets/a.js"', 'href="//elsewhere"'):
        assert said in text
    assert f'<meta name="{BASE_NAME}" content="{BASE}" />' in text


def test_base_paths_and_proxies_are_checked_at_the_start() -> None:
    for given, kept in (("", ""), ("/", ""), ("/arena/", "/arena"), ("/a/b-c.d_~", "/a/b-c.d_~")):
        assert load_settings(base_path=given).base_path == kept
    bad = ["arena", "//arena", "/a//b", "/a b", "/a?b", "/a#b", "/../a", "/a/..", "/.", "/a%2f"]
    bad += ["/ä", '/"', "https://host/arena", "/a\n", "/v1/x", *(f"/{name}" for name in OWN_PATHS)]
    for path in bad:
        told = r"BUILDARENA_BASE_PATH: .*(must begin|its own paths)"
        with pytest.raises(StartupError, match=told):
            load_settings(base_path=path)
    assert Settings().trusted_proxies == ""
    assert Settings(trusted_proxies="10.0.0.0/8, ::1").trusted_proxies == "10.0.0.0/8,::1"
    for names in ("*", "proxy.example", "10.0.0.0/8,*", "127.0.0.1:80"):
        with pytest.raises(ValidationError, match="neither an address nor a network"):
            Settings(trusted_proxies=names)


@pytest.mark.parametrize(
    ("trusted", "seen", "answered"),
    [
        (PROXIES, "10.0.0.{}", {4}),
        ("", "10.0.0.{}", {1, 2}),
        # What stands in front of the proxy's own words, a client can have made up.
        (PROXIES, "10.0.0.{}, 10.1.1.1", {1, 2}),
    ],
    ids=["a proxy", "a stranger", "a made up chain"],
)
def test_rate_limits_go_by_a_trusted_proxys_client(
    context, monkeypatch, trusted, seen, answered
) -> None:
    """One an hour; a broker that is slow for a moment lets a process count one more alone."""
    # What the server itself reads, and trusts by default, must not matter.
    monkeypatch.setenv("FORWARDED_ALLOW_IPS", "*")
    limited = live_api(context, trusted_proxies=trusted, rate_limit="1/hour")
    with limited as url, httpx.Client(base_url=url) as client:
        told = [{"X-Forwarded-For": seen.format(number)} for number in range(4)]
        found = [client.get("/v1/models", headers=headers).status_code for headers in told]
    assert set(found) <= {200, 429}
    assert found.count(200) in answered
