"""A category is a folder: one that is added is known and played, and nothing else names it."""

import json
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest
from support.programs import captured
from support.servers.stacks import running_stack, wait_until

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.categories import categories
from buildarena_benchmark.experts import expert_designs

PLAY = """
import json
from buildarena_benchmark import builtin_tasks, references
from buildarena_benchmark.environment import Environment
from buildarena_benchmark.environment.expert_calls import calls_of
from buildarena_benchmark.scoring.registry import known_scorers

environment = Environment("ropeway-1", simulator="mujoco")
for call in calls_of("ropeway-1", 0):
    assert environment.step(call["tool"], call["arguments"], machine=call["machine"]).ok
trial = environment.submit().trial
print(json.dumps([list(builtin_tasks())[0], references()["ropeway-1"], "span" in known_scorers(),
                  trial.score.success, trial.score.indicator]))
"""


def test_each_category_has_its_tasks_experts_and_references() -> None:
    names = [task.category for task in builtin_tasks().values()]
    assert list(dict.fromkeys(names)) == [category.name for category in categories()]
    assert set(expert_designs()) == set(builtin_tasks())
    for category in categories():
        assert (category.folder / "README.md").is_file()
        own = {name for name, task in builtin_tasks().items() if task.category == category.name}
        assert set(category.references) == own
        assert set(category.paper) <= own


@pytest.fixture
def ropeway(tmp_path: Path) -> Path:
    """Bridges under another name, with their own scorer."""
    (support,) = (category.folder for category in categories() if category.name == "support")
    folder = Path(shutil.copytree(support, tmp_path / "ropeway"))
    for file in folder.glob("support-*.yaml"):
        file.unlink()
    task = (support / "support-1.yaml").read_text("utf-8")
    for old, new in (
        ("name: support-1", "name: ropeway-1"),
        ("category: support", "category: ropeway"),
        ("  name: support\n", "  name: span\n"),
    ):
        task = task.replace(old, new)
    (folder / "ropeway-1.yaml").write_text(task, "utf-8")
    (folder / "category.yaml").write_text(
        "title: Ropeways\norder: 0\nreferences: {ropeway-1: 7.5}\n", "utf-8"
    )
    expert = (folder / "expert.py").read_text("utf-8").replace('"support-', '"ropeway-')
    (folder / "expert.py").write_text(expert, "utf-8")
    (folder / "scorer.py").write_text(
        "from dataclasses import replace\n"
        "from typing import Literal\n"
        "from buildarena_benchmark.scoring import support\n"
        "class SpanScoring(support.SupportScoring):\n"
        '    name: Literal["span"]\n'
        "SCORER = replace(support.SCORER, parameters=SpanScoring)\n",
        "utf-8",
    )
    return folder


def test_a_folder_that_is_added_is_a_category(ropeway) -> None:
    variables = {**os.environ, "BUILDARENA_CATEGORIES": str(ropeway)}
    done = captured([sys.executable, "-c", PLAY], env=variables)
    assert done.returncode == 0, done.stderr
    first, reference, scores, success, indicator = json.loads(done.stdout)
    assert (first, reference, scores, success) == ("ropeway-1", 7.5, True, True)
    assert indicator > 1000


@pytest.mark.ci
def test_it_is_played_by_a_service_and_ranked(ropeway, monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("BUILDARENA_CATEGORIES", str(ropeway))
    with running_stack(tmp_path) as stack, httpx.Client(base_url=stack.url, timeout=60) as api:
        listed = {task["name"]: task for task in api.get("/v1/tasks").json()["data"]}
        assert listed["ropeway-1"]["category_title"] == "Ropeways"
        asked = {"task": "ropeway-1", "model": "builtin/expert", "simulator": "mujoco", "worlds": 1}
        job = api.post("/v1/jobs", json=asked).raise_for_status().json()["id"]

        def found() -> dict[str, Any]:
            return api.get(f"/v1/jobs/{job}").json()

        wait_until(lambda: found()["state"] == "done", 60, "it is played")
        assert found()["explanation"].startswith("It passed 2 of 2 worlds. In the exact one: ")
        board = api.get("/v1/leaderboard", params={"category": "ropeway"}).json()
        (task,) = board["tasks"]
        assert (task["task"], task["rows"][0]["successes"]) == ("ropeway-1", 1.0)
