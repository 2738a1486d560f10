"""The example notebooks run from their first cell to their last, as they are committed."""

import os
import re
from pathlib import Path

import httpx
import nbformat
import pytest
from nbclient import NotebookClient
from support.servers.live_api import live_api
from support.stages import work

from buildarena import pages

FOLDER = Path(__file__).parents[2] / "examples" / "notebooks"
SWEEP = {
    "name": "two",
    "tasks": ["support-1"],
    "models": ["builtin/expert", "builtin/idle"],
    "seeds": [0],
    "simulator": "mujoco",
}
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")


@pytest.fixture(autouse=True)
def own_places(tmp_path, monkeypatch):
    for name in ("JUPYTER_CONFIG_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")


def run(notebook, folder: Path):
    client = NotebookClient(
        notebook, timeout=120, resources={"metadata": {"path": str(folder)}}, kernel_name="python3"
    )
    return client.execute(env={**os.environ, "PYTHONWARNINGS": "default"})


def shown(notebook, kind: str) -> list[str]:
    """What cells showed."""
    return [
        output["data"][kind]
        for cell in notebook.cells
        for output in cell.get("outputs", ())
        if kind in output.get("data", {})
    ]


def printed(notebook) -> str:
    return "".join(
        output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", ())
    )


def read(name: str):
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


def test_notebooks_are_kept_without_outputs(subtests):
    for file in sorted(FOLDER.glob("*.ipynb")):
        with subtests.test(file=file):
            notebook = nbformat.read(file, as_version=4)
            nbformat.validate(notebook)
            code = [cell for cell in notebook.cells if cell.cell_type == "code"]
            assert code
            assert not [cell for cell in code if cell.outputs or cell.execution_count is not None]


@pytest.mark.ci
def test_a_bridge_is_built_and_tried(tmp_path):
    done = run(read("bridge"), tmp_path)
    machine, trial, braced = shown(done, "text/html")
    if pages.SCRIPT.is_file():
        assert all("<iframe sandbox=" in html for html in (machine, trial, braced))
    assert "no success, load 0.00" in trial
    assert any("Refused (face_occupied)" in text for text in shown(done, "text/plain"))
    assert re.search(r"\b0 became \d{3,4} mass units", printed(done))
    assert list(tmp_path.glob("*.html")) == []


@pytest.mark.ci
def test_designs_are_compared(tmp_path):
    done = run(read("designs"), tmp_path)
    lines = re.findall(r"(\d) braces: +([\d.]+)", printed(done))
    assert [int(line[0]) for line in lines] == [0, 2, 4, 6]
    assert float(lines[-1][1]) > 2 * float(lines[0][1])
    assert "(pybullet)" in shown(done, "text/html")[-1]


@pytest.mark.ci
def test_a_service_is_read(tmp_path, context, monkeypatch):
    with live_api(context) as url:
        httpx.post(f"{url}/v1/sweeps", json=SWEEP).raise_for_status()
        work(context)
        monkeypatch.setenv("BUILDARENA_URL", url)
        done = run(read("service"), tmp_path)
    board, jobs = shown(done, "text/plain")[:2]
    assert "builtin/expert" in board
    assert "construction_failed" in jobs
    assert "success, load" in shown(done, "text/html")[-1]


@pytest.mark.ci
def test_a_cell_that_fails_is_a_failure(tmp_path):
    from nbclient.exceptions import CellExecutionError

    broken = read("bridge")
    broken.cells[1].source += "\nassert bridge.attach_block_to('1', 'E', 'Wheel')"
    with pytest.raises(CellExecutionError):
        run(broken, tmp_path)
