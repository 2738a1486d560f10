"""What registers of evaluations ask for: a project that installs, tasks that a file shows."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from scripted_models import call, listed

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.tasks.task import SCORER_VERSION
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_inspect import tasks as task_file
from buildarena_inspect.task_factory import TASKS
from buildarena_inspect.versions import inspect_version
from buildarena_simulation import SIMULATION_VERSION, engine_version

pytestmark = pytest.mark.nightly

HERE = Path(__file__).parent
REVIEW = HERE / "register_review.py"
PYTHON = Path(sys.executable)


def test_each_task_has_a_function_under_both_names(run) -> None:
    functions = {name: value for name, value in vars(task_file).items() if name in TASKS}
    assert functions.keys() | {"all"} == TASKS.keys()
    nothing = listed(call("submit", {}))
    for name in ("buildarena/support_1", "buildarena_inspect/support_1"):
        assert run(name, nothing, message_limit=4).eval.task == name


def test_versions_have_the_registers_form_and_logs_name_all_of_them(run) -> None:
    log = run("buildarena/support_1", listed(call("submit", {})), message_limit=4)
    assert re.fullmatch(r"[1-9][0-9]*-[A-Z]", log.eval.task_version)
    assert log.eval.metadata == {
        "adapter_version": version("buildarena-inspect"),
        "simulator": "pybullet",
        "engine_version": engine_version("pybullet"),
        "simulation_version": SIMULATION_VERSION,
        "scorer_version": SCORER_VERSION,
        "feedback_version": FEEDBACK_VERSION,
        "task_versions": {"support-1": builtin_tasks()["support-1"].version},
    }


def reviewed(folder: Path, *tasks: str) -> list[str]:
    done = subprocess.run(
        [PYTHON, REVIEW, folder, *tasks], capture_output=True, text=True, check=False
    )
    if done.returncode and "Failed to fetch" in done.stderr:
        if os.environ.get("CI"):
            pytest.fail(done.stderr)
        pytest.skip("uv sync needs a package index, and none answers")
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.timeout(600)
def test_a_clone_is_installed_and_evaluated_as_a_register_does(tmp_path) -> None:
    count, *logs = reviewed(tmp_path, "support_1", "drive_1")
    assert count == f"{len(TASKS)} tasks"
    assert sorted(line.split() for line in logs) == [
        ["again", "success", inspect_version(["support-1"]), "2", "support_1"],
        ["drive_1", "success", inspect_version(["drive-1"]), "1", "drive_1"],
        ["set", "success", inspect_version(["drive-1"]), "1", "drive_1"],
        ["set", "success", inspect_version(["support-1"]), "1", "support_1"],
        ["support_1", "success", inspect_version(["support-1"]), "1", "support_1"],
        ["whole", "success", inspect_version(["support-1"]), "2", "support_1"],
    ]
