"""A published site holds exactly what the service answers, and is whole or not there."""

import errno
import fcntl
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from urllib.parse import urlencode

import httpx
import pytest
from support.clients.commands import printed, run_cli
from support.clients.tenants import ADMIN, WITH_KEYS
from support.servers.live_api import live_api
from support.stages import work

from buildarena_api.dashboard import POLICY
from buildarena_cli.site import writing
from buildarena_cli.site.folder import MARKER, Folder
from buildarena_cli.site.scope import Scope, choose_jobs, read_choice
from buildarena_client.config import KEY_VARIABLE
from buildarena_simulation.arrow import MEDIA_TYPE as ARROW

PAGE = (
    '<!doctype html><html><head>\n<meta charset="utf-8" />\n<script src="/scheme.js"></script>'
    '<script type="module" crossorigin src="/assets/index-1.js"></script></head>'
    '<body><div id="root"></div><noscript>At /v1.</noscript></body></html>'
)
IDLE = {"tasks": ["support-1"], "models": ["builtin/idle"], "simulator": "mujoco", "name": "idle"}
EXPERT = {**IDLE, "name": "both", "models": ["builtin/expert", "builtin/idle"], "seeds": [0]}


@pytest.fixture(autouse=True)
def pages(tmp_path, monkeypatch) -> Path:
    """Pages as a build leaves them: what is tested here does not depend on what they do."""
    folder = tmp_path / "pages"
    (folder / "assets").mkdir(parents=True)
    (folder / "index.html").write_text(PAGE)
    for name in ("scheme.js", "assets/index-1.js", "assets/index-1.js.br", ".built"):
        (folder / name).write_text("0")
    monkeypatch.setattr(writing, "built_pages", lambda: folder)
    return folder


def submitted(url: str, spec: dict, **headers: str) -> str:
    answer = httpx.post(f"{url}/v1/sweeps", json=spec, headers=headers).raise_for_status()
    return str(answer.json()["id"])


@pytest.fixture
def idle(url, context) -> str:
    """A sweep of two jobs that have ended without a machine."""
    sweep = submitted(url, {**IDLE, "seeds": [0, 1]})
    work(context)
    return sweep


def files_of(site: Path) -> set[str]:
    return {file.relative_to(site).as_posix() for file in site.rglob("*") if file.is_file()}


def read(site: Path, name: str = "site.json"):
    return json.loads((site / name).read_bytes())


def asked(url: str, question: str, sweeps: list[str]) -> httpx.Response:
    path, _, words = question.partition("?")
    params = [tuple(word.split("=", 1)) for word in words.split("&") if word]
    if path.startswith("/v1/leaderboard"):
        params += [("sweep", id_) for id_ in sweeps]
    accept = {"Accept": ARROW} if path.endswith("/trajectory") else {}
    return httpx.get(f"{url}{path}?{urlencode(params)}", headers=accept)


@pytest.mark.nightly
def test_every_answer_is_the_services(url, context, tmp_path) -> None:
    sweeps = [submitted(url, EXPERT), submitted(url, {**IDLE, "seeds": [0, 5]})]
    submitted(url, {**IDLE, "tasks": ["lift-1"], "seeds": [9]})
    work(context)
    site = tmp_path / "site"
    said = printed(url, "site", *sweeps, "--out", str(site))
    assert "3 jobs, all with transcript, replay and trials" in said
    whole = read(site)
    rows = read(site, whole["jobs"])
    indexes = [read(site, f"jobs/{job}.json")["answers"] for job in rows["kept"]]
    wanted = {".nojekyll", MARKER, "index.html", "site.json", whole["jobs"]}
    wanted |= {"scheme.js", "assets/index-1.js"}
    wanted |= {f"jobs/{job}.json" for job in rows["kept"]}
    for answers in (whole["answers"], *indexes):
        for question, name in answers.items():
            answer = asked(url, question, sweeps)
            if name is None:
                assert answer.status_code == 404, question
                continue
            wanted.add(name)
            content = (site / name).read_bytes()
            assert name.replace("/", "").startswith(f"data{sha256(content).hexdigest()[:40]}")
            # Lists hold what was asked for alone, and what grows meanwhile is left out here.
            lists = question in {"/v1/tasks", "/v1/models", "/v1/sweeps?limit=50"}
            grows = re.fullmatch(r"/v1/(sweeps|jobs)/[^/]+(/artifacts)?", question)
            if not (lists or grows or name.endswith(".parquet")):
                assert content == answer.content, question
    assert files_of(site) == wanted
    assert sum(name.endswith(".arrow") for name in wanted) == 1
    for sweep in sweeps:
        found = httpx.get(f"{url}/v1/jobs", params={"sweep": sweep}).json()["data"]
        assert [rows["jobs"][place] for place in rows["sweeps"][sweep]] == found
    assert len(rows["jobs"]) == 3
    paths = {name: whole["answers"][f"/v1/{name}"] for name in ("tasks", "models")}
    told = {name: read(site, path)["data"] for name, path in paths.items()}
    assert [task["name"] for task in told["tasks"]] == ["support-1"]
    assert {one["name"] for one in told["models"]} == {"builtin/expert", "builtin/idle"}
    page = (site / "index.html").read_text()
    assert re.findall(r'(?:src|href)="([^"]*)"', page) == ["./scheme.js", "./assets/index-1.js"]
    assert page.index("Content-Security-Policy") < page.index("<script")
    assert "/v1" not in page


def test_its_policy_is_the_services() -> None:
    told = [part for part in POLICY.split("; ") if not part.startswith("frame-ancestors")]
    assert "; ".join(told) == writing.POLICY


@pytest.mark.ci
def test_no_key_is_in_it(context, tmp_path, monkeypatch) -> None:
    with live_api(context, **WITH_KEYS) as url:
        sweep = submitted(url, {**IDLE, "seeds": [0]}, Authorization=f"Bearer {ADMIN}")
        work(context)
        site = tmp_path / "site"
        assert run_cli(url, "site", sweep, "--out", str(site)).returncode == 1
        assert not site.exists()
        monkeypatch.setenv(KEY_VARIABLE, ADMIN)
        printed(url, "site", sweep, "--out", str(site))
    assert len(files_of(site)) > 20
    assert not [name for name in files_of(site) if ADMIN.encode() in (site / name).read_bytes()]


@contextmanager
def no_space_for(place: str) -> Iterator[None]:
    """Files whose names begin so cannot be written."""
    real = Folder.write

    def write(self, name: str, content: bytes) -> None:
        if name.startswith(place):
            raise OSError(errno.ENOSPC, "No space left on device")
        real(self, name, content)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Folder, "write", write)
        yield


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("place", ["site.json", "data/", "jobs/", "index.html"])
def test_a_run_that_breaks_off_leaves_nothing_that_looks_whole(url, idle, tmp_path, place) -> None:
    site = tmp_path / "site"
    with no_space_for(place):
        done = run_cli(url, "site", idle, "--out", str(site))
    assert (done.returncode, "No space left" in done.stderr) == (1, True)
    assert "index.html" not in files_of(site)
    printed(url, "site", idle, "--out", str(site))
    assert "index.html" in files_of(site)
    assert not [name for name in files_of(site) if "partial" in name]


@pytest.mark.ci
def test_a_site_stays_whole_while_it_is_written_again(url, idle, context, tmp_path) -> None:
    site = tmp_path / "site"
    printed(url, "site", idle, "--out", str(site))
    (site / "CNAME").write_text("boards.example.org")
    before = (site / "site.json").read_bytes()
    more = submitted(url, {**IDLE, "name": "more", "seeds": [7]})
    work(context)
    with no_space_for("site.json"):
        assert run_cli(url, "site", idle, more, "--out", str(site)).returncode == 1
    assert (site / "site.json").read_bytes() == before
    assert {name for name in read(site)["answers"].values() if name} <= files_of(site)
    waiting = submitted(url, {**IDLE, "name": "waiting", "seeds": [3]})
    words = [idle, more, waiting, "--jobs", "none"]
    assert "1 job had not ended." in printed(url, "site", *words, "--out", str(site))
    assert not [name for name in files_of(site) if name.startswith("jobs/")]
    now = read(site)
    named = {name for name in now["answers"].values() if name} | {now["jobs"]}
    assert {name for name in files_of(site) if name.startswith("data/")} == named
    assert (site / "CNAME").exists(), "what somebody else has put beside it is theirs"


def test_what_is_refused_leaves_no_site(url, idle, tmp_path, subtests) -> None:
    waiting = submitted(url, {**IDLE, "seeds": [9], "name": "waiting"})
    for folder, names in (("home", ["a.tex", "b.tex"]), ("newer", []), ("locked", [])):
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / name).touch()
    (tmp_path / "file").touch()
    (tmp_path / "newer" / MARKER).write_text("99")
    lock = (tmp_path / "locked" / MARKER).open("w")
    fcntl.flock(lock, fcntl.LOCK_EX)
    for out, words, says in (
        ("home", [idle], "a.tex, b.tex"),
        ("file", [idle], "is a file"),
        ("newer", [idle], "another version"),
        ("locked", [idle], "another process is writing"),
        ("site", [idle, "--track", "nobody/plays"], "valid tracks: five-role+data-sheets/mujoco"),
        ("site", [idle, "--jobs", "worst"], "all, best, none or a number"),
        ("site", [idle, "--jobs=-1"], "--jobs: '-1'"),
        ("site", [], "--track"),
        ("site", ["sweep_00000000"], "no sweep's id begins"),
        ("site", [waiting], "none of these jobs has ended"),
    ):
        with subtests.test(says=says):
            done = run_cli(url, "site", *words, "--out", str(tmp_path / out))
            assert (done.returncode != 0, says in done.stderr) == (True, True), done.stderr
            assert not (tmp_path / out / "index.html").exists()
    lock.close()
    assert files_of(tmp_path / "home") == {"a.tex", "b.tex"}


def row(id_: str, **change: object) -> dict[str, object]:
    usual = dict.fromkeys(("task", "task_version", "configuration", "track"), "x")
    usual |= {"state": "done", "success": 1.0, "indicator": 1.0, "seed": 0, "flags": []}
    return {"id": id_, **usual, **change}


def test_the_best_of_a_cell_are_kept() -> None:
    rows = [
        row("failed", success=0.0, indicator=9.0),
        row("flagged", indicator=8.0, flags=["cheat"]),
        row("noted", indicator=7.0, flags=["never_fell"]),
        row("later", indicator=7.0, seed=3),
        row("unscored", success=None, indicator=None, flags=None),
        row("open", state="running"),
        row("elsewhere", configuration="d", indicator=0.0),
    ]
    scope = Scope(sweeps=[], track="k", tracks=["k"], jobs=rows, disqualifying=frozenset({"cheat"}))
    for choice, kept in (
        ("best", ["noted", "elsewhere"]),
        ("2", ["noted", "later", "elsewhere"]),
        ("4", ["noted", "later", "failed", "flagged", "elsewhere"]),
        ("none", []),
        ("all", [job["id"] for job in rows if job["state"] == "done"]),
    ):
        assert [job["id"] for job in choose_jobs(scope, read_choice(choice))] == kept
