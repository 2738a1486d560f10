"""The dashboard's pages as the API serves them, and what they may never stand in the place of."""

import gzip
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route
from starlette.testclient import TestClient

from buildarena_api.dashboard import Dashboard
from buildarena_api.job_records import preview_job

INDEX = b"<!doctype html><title>index</title>" + b" " * 600
SCRIPT = b"console.log(1);" * 100
SECRET = "not for everybody"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    pages = tmp_path / "pages"
    (pages / "assets").mkdir(parents=True)
    (tmp_path / "secret.txt").write_text(SECRET)
    (pages / ".built").write_text(SECRET)
    (pages / "index.html").write_bytes(INDEX)
    script = pages / "assets" / "main-abc123.js"
    script.write_bytes(SCRIPT)
    Path(f"{script}.gz").write_bytes(gzip.compress(SCRIPT, mtime=0))
    Path(f"{script}.br").write_bytes(b"brotli")
    return pages


def served(folder: Path) -> TestClient:
    app = Starlette(routes=[Route("/v1/health", lambda _: PlainTextResponse("api"))])
    app.router.default = Dashboard(app.router.default, folder=folder)
    return TestClient(app)


@pytest.fixture
def pages(folder: Path) -> Iterator[TestClient]:
    with served(folder) as client:
        yield client


def test_addresses_of_pages_get_the_page_and_nothing_else_does(pages) -> None:
    ours = ["/", "/sweeps", "/sweeps/sweep_1", "/jobs/job_1?view=trial", "/tasks/x", "/models/a/b"]
    for path in ours:
        answer = pages.get(path)
        assert (answer.status_code, answer.content) == (200, INDEX), path
        assert answer.headers["cache-control"] == "no-cache"
    assert pages.head("/").content == b""
    others = [
        *("/v1/nothing", "/v1", "/docs/x", "/openapi.jsonx", "/sweepsx", "/.built", "/favicon.ico"),
        *("/assets/", "/assets/gone.js", "/assets/main-abc123.js.gz", "/index.html"),
        *("/../secret.txt", "/assets/../../secret.txt", "/assets/%2e%2e/%2e%2e/secret.txt"),
        *("/..%2fsecret.txt", "http://testserver//secret.txt", "/assets\\..\\..\\secret.txt"),
        "/jobs%0a",
    ]
    for path in others:
        answer = pages.get(path)
        assert SECRET not in answer.text
        assert answer.status_code == 404, path
    assert pages.get("/v1/health").text == "api", "the API comes first"
    for method in ("POST", "PUT", "DELETE", "PATCH"):
        assert pages.request(method, "/sweeps").status_code == 404


def test_hashed_files_stay_with_the_reader(pages) -> None:
    answer = pages.get("/assets/main-abc123.js")
    assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert answer.headers["content-type"].startswith("text/javascript")
    again = pages.get("/assets/main-abc123.js", headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304
    assert again.content == b""


def test_files_come_as_compressed_as_the_reader_takes_them(folder) -> None:
    path, tags = "/assets/main-abc123.js", {}
    with served(folder) as client:
        for accept, encoding in (
            *(("gzip", "gzip"), ("gzip, br", "br"), ("br;q=0, gzip;q=0.5", "gzip"), ("BR", "br")),
            *((text, None) for text in ("br;q=0.000, gzip;q=0", "identity", "", "brotli")),
        ):
            with client.stream("GET", path, headers={"Accept-Encoding": accept}) as answer:
                body = b"".join(answer.iter_raw())
            assert answer.headers.get("content-encoding") == encoding, accept
            assert answer.headers["vary"] == "Accept-Encoding"
            bodies = {None: SCRIPT, "gzip": gzip.compress(SCRIPT, mtime=0), "br": b"brotli"}
            assert body == bodies[encoding]
            tags[encoding] = answer.headers["etag"]
    assert len({*tags.values()}) == 3


def test_pages_run_no_script_but_their_own(pages) -> None:
    parts = pages.get("/").headers["content-security-policy"].split(";")
    policy = dict(part.strip().split(" ", 1) for part in parts)
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == "'self'"
    assert policy["connect-src"] == "'self'"
    assert policy["frame-ancestors"] == "'none'"


def test_a_link_to_a_job_has_a_title_a_sentence_and_a_picture(folder) -> None:
    app = Starlette()
    told = {"job_1a": ('"Bridge" <b>', "It broke after 5.6 s.")}
    app.router.default = Dashboard(
        app.router.default, folder=folder, base="/arena", preview=told.get
    )
    with TestClient(app) as client:
        text = client.get("/jobs/job_1a?t=5").text
        assert "<title>&quot;Bridge&quot; &lt;b&gt; · BuildArena</title>" in text
        assert 'og:description" content="It broke after 5.6 s."' in text
        assert 'og:image" content="http://testserver/arena/v1/jobs/job_1a/thumbnail.png"' in text
        for path in ("/", "/jobs/job_2", "/jobs", "/jobs/job_1a/x"):
            assert "og:" not in client.get(path).text, path


def test_what_a_link_tells_is_the_jobs(api, context) -> None:
    sent = {"task": "support-1", "model": "builtin/idle", "simulator": "mujoco"}
    job = api.post("/v1/jobs", json=sent).json()["id"]
    title = "A bridge over a gap of 5 · builtin/idle"
    assert preview_job(context, job) == (title, "This run has not ended.")
    api.post(f"/v1/jobs/{job}/cancel")
    assert preview_job(context, job) == (title, "The job was cancelled.")
    assert preview_job(context, "job_0") is None


def test_somebody_who_visits_no_page_gets_one_that_leads_on(pages) -> None:
    visit = {"sec-fetch-dest": "document", "accept": "text/html"}
    answer = pages.get("/nonsense/here", headers=visit)
    assert (answer.status_code, answer.content) == (404, INDEX)
    assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
    assert pages.get("/nonsense/here").content != INDEX
    for path in ("/v1", "/v1/jobz", "/docs/x", "/assets/gone.js", "/openapi.json"):
        assert pages.get(path, headers=visit).content != INDEX, path
    assert pages.post("/nonsense", headers=visit).content != INDEX


def test_without_a_build_the_start_says_how_to_make_one(tmp_path) -> None:
    with served(tmp_path / "none") as client:
        answer = client.get("/")
        assert "make web" in answer.text
        assert "<script" not in answer.text
        assert client.get("/assets/main.js").status_code == 404


def test_the_application_serves_it_beside_the_api(api) -> None:
    start = api.get("/")
    assert start.status_code == 200
    assert "BuildArena" in start.text
    assert start.headers["x-frame-options"] == "DENY"
    assert api.get("/openapi.json").json()["info"]["title"] == "BuildArena"
