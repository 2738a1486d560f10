"""The example notebooks and the documentation's examples run as they stand, with a service too."""

import doctest
import os
import re
from pathlib import Path

import httpx
import nbformat
import pytest
from nbclient import NotebookClient
from support.servers.live_api import live_api
from support.stages import work

import buildarena as ba
from buildarena import pages
from buildarena_client import ClientError, NotFoundError, UnreachableError

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "examples" / "notebooks"
SWEEP = {"name": "two", "tasks": ["support-1"], "seeds": [0], "simulator": "mujoco"}
SWEEP["models"] = ["builtin/expert", "builtin/idle"]
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")


@pytest.fixture(autouse=True)
def own_places(tmp_path, monkeypatch):
    for name in ("JUPYTER_CONFIG_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def url(context, monkeypatch):
    """A service with a job that succeeded, and one that built nothing."""
    with live_api(context) as url:
        httpx.post(f"{url}/v1/sweeps", json=SWEEP).raise_for_status()
        work(context)
        monkeypatch.setenv("BUILDARENA_URL", url)
        yield url


def run(name: str, folder: Path):
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    where = {"metadata": {"path": str(folder)}}
    client = NotebookClient(notebook, timeout=120, resources=where, kernel_name="python3")
    return client.execute(env={**os.environ, "PYTHONWARNINGS": "default"})


def outputs(notebook) -> list:
    return [output for cell in notebook.cells for output in cell.get("outputs", ())]


def shown(notebook, kind: str) -> list[str]:
    """What cells showed."""
    return [o["data"][kind] for o in outputs(notebook) if kind in o.get("data", {})]


def printed(notebook) -> str:
    return "".join(output.get("text", "") for output in outputs(notebook))


def test_notebooks_are_kept_without_outputs():
    for file in sorted(FOLDER.glob("*.ipynb")):
        notebook = nbformat.read(file, as_version=4)
        nbformat.validate(notebook)
        code = [cell for cell in notebook.cells if cell.cell_type == "code"]
        assert code, file.name
        assert not [cell for cell in code if cell.outputs or cell.execution_count is not None]


@pytest.mark.ci
def test_bridges_are_built_tried_and_compared(tmp_path):
    done = run("bridge", tmp_path)
    machine, trial, braced = shown(done, "text/html")
    if pages.SCRIPT.is_file():
        assert all("<iframe sandbox=" in html for html in (machine, trial, braced))
    assert "no success, load 0.00" in trial
    assert any("Refused (face_occupied)" in text for text in shown(done, "text/plain"))
    assert re.search(r"\b0 became \d{3,4} mass units", printed(done))
    assert list(tmp_path.glob("*.html")) == []
    done = run("designs", tmp_path)
    lines = re.findall(r"(\d) braces: +([\d.]+)", printed(done))
    assert [int(line[0]) for line in lines] == [0, 2, 4, 6]
    assert float(lines[-1][1]) > 2 * float(lines[0][1])


@pytest.mark.ci
def test_a_service_is_read_in_the_notebook_and_in_frames(tmp_path, url):
    done = run("service", tmp_path)
    board, jobs = shown(done, "text/plain")[:2]
    assert "builtin/expert" in board
    assert "construction_failed" in jobs
    assert "success, load" in shown(done, "text/html")[-1]
    for kind in ("pandas", "polars"):
        frame = ba.leaderboard(kind=kind)
        assert type(frame).__module__.startswith(kind)
        by_model = dict(zip(frame["model"], frame["success_rate"], strict=True))
        assert by_model == {"builtin/expert": 1.0, "builtin/idle": 0.0}
        assert len(ba.jobs(url, kind=kind)) == 2
        assert len(ba.jobs(url, kind=kind, model="builtin/idle")) == 1


def test_a_job_s_machine_and_trial_are_those_that_are_kept(url):
    jobs = {job["model"]: job for job in httpx.get(f"{url}/v1/jobs").json()["data"]}
    good, empty = jobs["builtin/expert"], jobs["builtin/idle"]
    machine, trial = ba.job_machine(good["id"]), ba.job_trial(good["id"], url)
    assert machine.to_document() == httpx.get(f"{url}/v1/jobs/{good['id']}/machine").json()
    assert isinstance(machine, ba.Machine)
    assert trial.machine == machine
    assert (trial.score.success, trial.score.indicator) == (True, good["indicator"])
    for read in (ba.job_machine, ba.job_trial):
        with pytest.raises(ClientError, match=f"{empty['id']} has no .*: plan_unreadable"):
            read(empty["id"])
        with pytest.raises(NotFoundError):
            read("job_00000000000000000000")
        with pytest.raises(ClientError):
            read("../sweeps")
    for read in (ba.leaderboard, ba.jobs):
        with pytest.raises(UnreachableError, match=r"127\.0\.0\.1:9"):
            read("http://127.0.0.1:9")
    with pytest.raises(ClientError, match="not a kind of frame"):
        ba.jobs("http://127.0.0.1:9", kind="excel", limit=0)


@pytest.mark.ci
def test_the_documentation_s_examples_do_what_they_say(tmp_path):
    for page in ("docs/notebooks.md", "clients/cli/README.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        test = doctest.DocTestParser().get_doctest(text, {}, page, page, 0)
        assert len(test.examples) > 5
        assert doctest.DocTestRunner(verbose=False).run(test).failed == 0
    assert (tmp_path / "bridge.html").stat().st_size > 1000
