"""What registers of evaluations ask for: a project that installs, tasks that a file shows."""

import re
from importlib.metadata import version

import pytest
from scripted_models import call, listed

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.tasks.task import SCORER_VERSION
from buildarena_geometry import FEEDBACK_VERSION
from buildarena_simulation import SIMULATION_VERSION, engine_version

pytestmark = pytest.mark.nightly


def test_versions_have_the_registers_form_and_logs_name_all_of_them(run) -> None:
    log = run("buildarena/support_1", listed(call("submit", {})), message_limit=4)
    assert re.fullmatch(r"[1-9][0-9]*-[A-Z]", log.eval.task_version)
    versions = {"simulation_version": SIMULATION_VERSION, "scorer_version": SCORER_VERSION}
    versions |= {"adapter_version": version("buildarena-inspect"), "simulator": "pybullet"}
    versions |= {"engine_version": engine_version("pybullet"), "feedback_version": FEEDBACK_VERSION}
    task_versions = {"support-1": builtin_tasks()["support-1"].version}
    assert log.eval.metadata == {**versions, "task_versions": task_versions}
