"""A published site holds exactly what the service answers, and is whole or not there."""

import errno
import json
import re
from hashlib import sha256
from pathlib import Path
from urllib.parse import urlencode

import httpx
import pytest
from support.clients.commands import printed, run_cli
from support.clients.tenants import ADMIN, WITH_KEYS
from support.servers.live_api import changed, live_api
from support.stages import work

from buildarena_cli.defaults import KEY_VARIABLE
from buildarena_cli.site import jobs as site_jobs
from buildarena_cli.site import pages as site_pages
from buildarena_cli.site import writing
from buildarena_cli.site.folder import Folder
from buildarena_simulation.arrow import MEDIA_TYPE as ARROW

PAGE = (
    '<!doctype html><html><head>\n<meta charset="utf-8" />\n<script src="/scheme.js"></script>'
    '<script type="module" crossorigin src="/assets/index-1.js"></script></head>'
    '<body><div id="root"></div><noscript>At /v1.</noscript></body></html>'
)
IDLE = {"tasks": ["support-1"], "models": ["builtin/idle"], "simulator": "mujoco", "name": "idle"}
EXPERT = {**IDLE, "name": "both", "models": ["builtin/expert", "builtin/idle"], "seeds": [0]}
SCOPED = "/v1/leaderboard"


@pytest.fixture(autouse=True)
def pages(tmp_path, monkeypatch) -> Path:
    """Pages as a build leaves them: what is tested here does not depend on what they do."""
    folder = tmp_path / "pages"
    (folder / "assets").mkdir(parents=True)
    (folder / "index.html").write_text(PAGE)
    for name in ("scheme.js", "assets/index-1.js", "assets/index-1.js.br", ".built"):
        (folder / name).write_text("0")
    monkeypatch.setattr(site_pages, "built_pages", lambda: folder)
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
    if path.startswith(SCOPED):
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
    made = {"/v1/tasks", "/v1/models", "/v1/sweeps?limit=50"}
    wanted = {".nojekyll", ".buildarena-site", "index.html", "site.json", whole["jobs"]}
    wanted |= {"scheme.js", "assets/index-1.js"}
    rows = read(site, whole["jobs"])
    indexes = [read(site, f"jobs/{job}.json")["answers"] for job in rows["kept"]]
    wanted |= {f"jobs/{job}.{ending}" for job in rows["kept"] for ending in ("json", "html")}
    page = (site / "index.html").read_text()
    picture = re.search(r'og:image" content="(data/[^"]*\.png)"', page)
    assert picture is not None
    assert picture[1] in files_of(site)
    trials = 0
    for answers in (whole["answers"], *indexes):
        for question, name in answers.items():
            if name is None:
                assert asked(url, question, sweeps).status_code == 404, question
                continue
            wanted.add(name)
            content = (site / name).read_bytes()
            assert name.replace("/", "").startswith(f"data{sha256(content).hexdigest()[:40]}")
            trials += name.endswith(".arrow")
            if question in made:
                continue
            answer = asked(url, question, sweeps)
            assert answer.status_code == 200, question
            if question.endswith("/artifacts"):
                kept = [f for f in answer.json() if not f["name"].startswith("trajectory")]
                assert json.loads(content) == kept
            elif re.fullmatch(r"/v1/sweeps/[^/]+", question):
                # A lower bound of the events that its figures hold: it may grow by itself.
                still = {"last_event": 0}
                assert json.loads(content) | still == answer.json() | still
            elif re.fullmatch(r"/v1/jobs/[^/]+", question):
                # Asking for its thumbnail has kept that as an artifact.
                said = answer.json()
                said["artifacts"].pop("thumbnail", None)
                assert json.loads(content) == said
            elif not name.endswith(".parquet"):
                assert content == answer.content, question
    assert files_of(site) == wanted
    assert trials == 1
    _check_lists(url, site, sweeps, rows, whole)


def _check_lists(url, site, sweeps, rows, whole) -> None:
    for sweep in sweeps:
        found = httpx.get(f"{url}/v1/jobs", params={"sweep": sweep}).json()["jobs"]
        places = rows["sweeps"][sweep]
        assert [rows["jobs"][place] for place in places] == found
    assert len(rows["jobs"]) == 3
    tasks = read(site, whole["answers"]["/v1/tasks"])
    assert [task["name"] for task in tasks] == ["support-1"]
    assert {one["name"] for one in read(site, whole["answers"]["/v1/models"])} == {
        "builtin/expert",
        "builtin/idle",
    }
    listed = read(site, whole["answers"]["/v1/sweeps?limit=50"])["sweeps"]
    assert {sweep["id"] for sweep in listed} == {*sweeps}
    board = read(site, whole["answers"]["/v1/leaderboard"])
    assert [task["task"] for task in board["tasks"]] == ["support-1"]


@pytest.mark.nightly
def test_the_first_page_finds_its_files_beside_itself(url, idle, tmp_path) -> None:
    printed(url, "site", idle, "--out", str(tmp_path / "site"))
    page = (tmp_path / "site" / "index.html").read_text()
    assert re.findall(r'(?:src|href)="([^"]*)"', page) == ["./scheme.js", "./assets/index-1.js"]
    assert '<meta name="buildarena-site" content="site.json" />' in page
    assert page.index("Content-Security-Policy") < page.index("<script")
    assert "/v1" not in page


def test_its_policy_is_the_services() -> None:
    from buildarena_api.dashboard.serving import POLICY

    told = [part for part in POLICY.split("; ") if not part.startswith("frame-ancestors")]
    assert "; ".join(told) == site_pages.POLICY


@pytest.mark.nightly
def test_no_key_is_in_it(context, tmp_path, monkeypatch) -> None:
    with changed(context, **WITH_KEYS) as own, live_api(own) as url:
        sweep = submitted(url, {**IDLE, "seeds": [0]}, Authorization=f"Bearer {ADMIN}")
        work(context)
        site = tmp_path / "site"
        assert run_cli(url, "site", sweep, "--out", str(site)).returncode == 1
        assert not site.exists()
        monkeypatch.setenv(KEY_VARIABLE, ADMIN)
        printed(url, "site", sweep, "--out", str(site))
    assert len(files_of(site)) > 20
    for name in files_of(site):
        assert ADMIN.encode() not in (site / name).read_bytes()


@pytest.mark.nightly
@pytest.mark.parametrize("place", ["data/", "jobs/", "site.json", "index.html"])
def test_a_run_that_breaks_off_leaves_nothing_that_looks_whole(
    url, idle, tmp_path, monkeypatch, place
) -> None:
    site = tmp_path / "site"
    with monkeypatch.context() as patched:
        _break(patched, place)
        done = run_cli(url, "site", idle, "--out", str(site))
    assert (done.returncode, "No space left" in done.stderr) == (1, True)
    assert "index.html" not in files_of(site)
    asked_for: list[str] = []
    real = site_jobs.job_answers

    def counting(client, job_id):
        asked_for.append(job_id)
        return real(client, job_id)

    monkeypatch.setattr(writing, "job_answers", counting)
    printed(url, "site", idle, "--out", str(site))
    assert "index.html" in files_of(site)
    assert not [name for name in files_of(site) if "partial" in name]
    # What an earlier run has kept of jobs is not asked for again.
    assert len(asked_for) == (0 if place.endswith((".json", ".html")) else 2)


def _break(patched, place: str) -> None:
    real = Folder.write

    def write(self, name: str, content: bytes) -> None:
        if name.startswith(place):
            raise OSError(errno.ENOSPC, "No space left on device")
        real(self, name, content)

    patched.setattr(Folder, "write", write)


@pytest.mark.nightly
def test_a_site_stays_whole_while_it_is_written_again(
    url, idle, context, tmp_path, monkeypatch
) -> None:
    site = tmp_path / "site"
    printed(url, "site", idle, "--out", str(site))
    (site / "CNAME").write_text("boards.example.org")
    before = (site / "site.json").read_bytes()
    more = submitted(url, {**IDLE, "name": "more", "seeds": [7]})
    work(context)
    with monkeypatch.context() as patched:
        _break(patched, "site.json")
        assert run_cli(url, "site", idle, more, "--out", str(site)).returncode == 1
    assert (site / "site.json").read_bytes() == before
    old = read(site)
    assert {name for name in old["answers"].values() if name} <= files_of(site)
    printed(url, "site", idle, more, "--out", str(site), "--jobs", "none")
    assert not [name for name in files_of(site) if name.startswith("jobs/")]
    now = read(site)
    assert len(now["sweeps"]) == 2
    named = {name for name in now["answers"].values() if name} | {now["jobs"]}
    assert {name for name in files_of(site) if name.startswith("data/")} == named
    # What somebody else has put beside it is theirs.
    assert (site / "CNAME").exists()


@pytest.mark.nightly
def test_a_job_that_changed_is_asked_for_again(url, idle, tmp_path) -> None:
    site = tmp_path / "site"
    printed(url, "site", idle, "--out", str(site))
    (job, _) = read(site, read(site)["jobs"])["kept"]
    index = site / "jobs" / f"{job}.json"
    known = json.loads(index.read_text())
    for damage in ({**known, "digest": "other"}, {"answers": {"/x": "../../etc/passwd"}}, [], 3):
        index.write_text(json.dumps(damage))
        printed(url, "site", idle, "--out", str(site))
        assert json.loads(index.read_text()) == known


@pytest.mark.nightly
def test_a_track_alone_is_a_site(url, idle, context, tmp_path) -> None:
    other = {**IDLE, "simulator": "pybullet", "seeds": [0]}
    submitted(url, other)
    work(context)
    board = httpx.get(f"{url}/v1/leaderboard").json()
    (track,) = (name for name in board["tracks"] if "mujoco" in name)
    assert len(board["tracks"]) == 2
    site = tmp_path / "site"
    printed(url, "site", "--track", track, "--out", str(site))
    whole = read(site)
    assert whole["sweeps"] == []
    assert len(read(site, whole["jobs"])["jobs"]) == 2
    assert read(site, whole["answers"]["/v1/leaderboard"])["tracks"] == [track]
    both = tmp_path / "both"
    printed(url, "site", idle, "--track", track, "--out", str(both))
    assert read(both)["sweeps"] == [idle]


@pytest.mark.nightly
def test_jobs_that_have_not_ended_are_told(url, idle, tmp_path) -> None:
    waiting = submitted(url, {**IDLE, "seeds": [3, 4, 5]})
    alone = run_cli(url, "site", waiting, "--out", str(tmp_path / "none"))
    assert (alone.returncode, "none of these jobs has ended" in alone.stderr) == (1, True)
    said = printed(url, "site", idle, waiting, "--out", str(tmp_path / "site"))
    assert "3 jobs had not ended." in said
    assert "3 jobs had not ended." in read(tmp_path / "site")["left_out"]
    assert len(read(tmp_path / "site", read(tmp_path / "site")["jobs"])["kept"]) == 2
