"""The service behind a reverse proxy: below a path, under an outer name, and over slow pieces."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest
from support.clients.tenants import ADMIN, WITH_KEYS
from support.servers.live_api import changed, live_api
from support.servers.reverse_proxy import ProxyRules, reverse_proxy
from typer.testing import CliRunner

from buildarena_api.dashboard.files import BASE_NAME, INDEX, read_pages
from buildarena_cli.main import app
from buildarena_pipeline.errors import StartupError
from buildarena_pipeline.runtime.context import Context
from buildarena_pipeline.runtime.settings import OWN_PATHS, load_settings

BASE = "/tools/arena"
PROXIES = "127.0.0.0/8"
BEARER = {"Authorization": f"Bearer {ADMIN}"}
SWEEP = {"tasks": ["support-1"], "models": ["builtin/idle"], "seeds": [0]}


@contextmanager
def served(context: Context, rules: ProxyRules, **settings: object) -> Iterator[str]:
    """The address of a service through a proxy."""
    with (
        changed(context, **settings) as own,
        live_api(own) as inner,
        reverse_proxy(inner, rules) as url,
    ):
        yield url


@pytest.fixture(params=[True, False], ids=["cut off", "passed on"])
def below(context: Context, request: pytest.FixtureRequest) -> Iterator[str]:
    """A service below a path, by a proxy that cuts it off and by one that does not."""
    rules = ProxyRules(prefix=BASE, cuts=request.param)
    with served(context, rules, base_path=BASE) as url:
        yield url


def test_the_api_works_below_a_path(below) -> None:
    assert below.endswith(BASE)
    with httpx.Client(timeout=20) as client:
        made = client.post(f"{below}/v1/sweeps", json=SWEEP)
        assert made.status_code == 202, made.text
        assert made.headers["Location"] == f"{BASE}/v1/sweeps/{made.json()['id']}"
        there = httpx.URL(below).join(made.headers["Location"])
        assert client.get(there).json()["id"] == made.json()["id"]
        slashed = client.get(f"{below}/v1/sweeps/")
        assert slashed.status_code == 307
        assert httpx.URL(slashed.headers["Location"]).path == f"{BASE}/v1/sweeps"
        assert client.delete(f"{below}/v1/sweeps").status_code == 405
        assert client.get(f"{below}/v1/nothing").status_code == 404


@pytest.mark.ci
def test_the_contract_and_its_page_name_the_path(below) -> None:
    contract = httpx.get(f"{below}/openapi.json").json()
    assert contract["servers"] == [{"url": BASE}]
    page = httpx.get(f"{below}/docs")
    assert f"{BASE}/openapi.json" in page.text
    script = f"{BASE}/static-offline-docs/swagger-ui-bundle.js"
    assert script in page.text
    assert httpx.get(httpx.URL(below).join(script)).status_code == 200


def test_the_path_without_its_slash_is_the_first_page(context) -> None:
    with served(context, ProxyRules(prefix=BASE), base_path=BASE) as url:
        assert httpx.get(url).content == httpx.get(f"{url}/").content
        assert httpx.get(url).status_code == 200
        rebound = httpx.get(url, headers={"Host": "rebound.example"})
        assert rebound.status_code == 421


def test_events_come_through_as_they_happen(below) -> None:
    """A proxy that is told nothing may keep them back; ours would show that they come late."""
    with httpx.Client(timeout=20) as client:
        sweep = client.post(f"{below}/v1/sweeps", json=SWEEP).json()["id"]
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


def test_commands_work_with_an_address_that_has_a_path(below) -> None:
    for words in (["model", "list", "--json"], ["doctor"], ["task", "list"]):
        done = CliRunner().invoke(app, [*words, "--url", below])
        assert "builtin/" in done.stdout or done.stdout.strip(), (words, done.output)
        assert "404" not in done.output
    made = CliRunner().invoke(
        app, ["job", "submit", "lift-1", "builtin/idle", "--url", f"{below}/"]
    )
    assert made.exit_code == 0, made.output


def test_a_service_with_a_base_path_still_answers_at_its_root(context) -> None:
    """As probes ask, who know of no proxy."""
    with served(context, ProxyRules(), base_path=BASE) as url:
        assert httpx.get(f"{url}/v1/health").status_code == 200
        assert httpx.get(f"{url}{BASE}/v1/health").status_code == 200
        assert httpx.get(f"{url}{BASE}x/v1/health").status_code == 404
        assert httpx.get(f"{url}{BASE}{BASE}/v1/health").status_code == 404


def test_the_first_page_names_its_files_below_the_path(tmp_path) -> None:
    (tmp_path / "index.html").write_text(
        '<html><head><script src="/assets/a.js"></script><a href="//elsewhere">x</a></head></html>'
    )
    (tmp_path / "favicon.svg").write_text("<svg/>")
    plain, below = read_pages(tmp_path), read_pages(tmp_path, base=BASE)
    text = below[INDEX].data.decode()
    assert f'src="{BASE}/assets/a.js"' in text
    assert 'href="//elsewhere"' in text
    assert f'<meta name="{BASE_NAME}" content="{BASE}" />' in text
    assert below[INDEX].etag != plain[INDEX].etag
    assert below["/favicon.svg"] == plain["/favicon.svg"]


@pytest.mark.parametrize(
    ("given", "kept"), [("", ""), ("/", ""), ("/arena/", "/arena"), ("/a/b-c.d_~", "/a/b-c.d_~")]
)
def test_a_base_path_is_kept_without_its_last_slash(given, kept) -> None:
    assert load_settings(base_path=given).base_path == kept


@pytest.mark.parametrize(
    "bad",
    [
        *("arena", "//arena", "/a//b", "/a b", "/a?b", "/a#b", "/../a", "/a/..", "/.", "/a%2f"),
        *("/ä", '/"', "https://host/arena", "/a\n", "/v1/x"),
        *(f"/{name}" for name in sorted(OWN_PATHS)),
    ],
)
def test_what_is_no_base_path_is_refused(bad) -> None:
    with pytest.raises(StartupError, match=r"BUILDARENA_BASE_PATH: .*(must begin|of its own)"):
        load_settings(base_path=bad)


def outer(
    context: Context, trusted: str, headers: dict[str, str], **more: object
) -> httpx.Response:
    """The redirect of a slash too many, which names scheme and host."""
    rules = ProxyRules(headers=headers, host="inner:8000")
    settings = {**WITH_KEYS, "trusted_proxies": trusted, **more}
    with served(context, rules, **settings) as url:
        return httpx.get(f"{url}/v1/models/", headers=BEARER)


FORWARDED = {"X-Forwarded-Proto": "https", "X-Forwarded-Host": "arena.example.org"}


def test_addresses_have_the_outer_scheme_and_host_behind_a_trusted_proxy(context) -> None:
    answer = outer(context, PROXIES, FORWARDED)
    assert answer.status_code == 307, answer.text
    assert answer.headers["Location"] == "https://arena.example.org/v1/models"


def test_addresses_have_scheme_host_and_path_of_the_outside(context) -> None:
    answer = outer(context, PROXIES, FORWARDED, base_path=BASE)
    assert answer.headers["Location"] == f"https://arena.example.org{BASE}/v1/models"


@pytest.mark.parametrize("trusted", ["", "10.0.0.0/8", "::1"])
def test_what_others_forward_is_ignored(context, trusted) -> None:
    answer = outer(context, trusted, FORWARDED)
    assert answer.headers["Location"] == "http://inner:8000/v1/models"


@pytest.mark.nightly(keep=4)
@pytest.mark.parametrize(
    "host", ["a b", "a/b", "evil@host", "a,b", "x" * 300, "[::1", "host:port", "host:999999"]
)
def test_a_forwarded_host_that_is_none_is_ignored(context, host) -> None:
    answer = outer(context, PROXIES, {"X-Forwarded-Host": host})
    assert answer.headers["Location"] == "http://inner:8000/v1/models"


def test_without_keys_a_forwarded_host_makes_no_foreign_name_ours(context) -> None:
    """A rebound name's page could send the header; its browser is as near as a local proxy."""
    rules = ProxyRules(headers={"X-Forwarded-Host": "localhost"}, host="rebound.example")
    with served(context, rules, trusted_proxies=PROXIES) as url:
        assert httpx.get(f"{url}/v1/models").status_code == 421


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(
    ("trusted", "seen", "least", "most"),
    [
        (PROXIES, "10.0.0.{}", 12, 12),
        ("", "10.0.0.{}", 2, 4),
        # What stands in front of the proxy's own words, a client can have made up.
        (PROXIES, "10.0.0.{}, 10.1.1.1", 2, 4),
    ],
    ids=["a proxy", "a stranger", "a made up chain"],
)
def test_rate_limits_go_by_the_client_that_a_trusted_proxy_saw(
    context, trusted, seen, least, most
) -> None:
    """Two an hour; a broker that is slow for a moment lets a process count two more alone."""
    with (
        changed(context, trusted_proxies=trusted, rate_limit="2/hour") as own,
        live_api(own) as url,
        httpx.Client(base_url=url) as client,
    ):
        found = [
            client.get("/v1/models", headers={"X-Forwarded-For": seen.format(number)}).status_code
            for number in range(6)
            for _ in range(2)
        ]
    assert set(found) <= {200, 429}
    assert least <= found.count(200) <= most
