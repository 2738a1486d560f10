"""Whoever names no engine gets the same one, at every door; one that is missing is refused."""

import inspect
import json

import pytest
from typer.testing import CliRunner

import buildarena as ba
from buildarena_api.routes.machines import TrialQuery
from buildarena_api.routes.sessions import OpenSession
from buildarena_benchmark import builtin_tasks
from buildarena_cli.main import app
from buildarena_environment import Environment, Evaluator, TrialPool, try_machine
from buildarena_geometry import Machine
from buildarena_pipeline.catalog.specs import JobSpec, SweepSpec
from buildarena_simulation import DEFAULT_ENGINE, UnknownEngineError, rollout, simulate

TASK = "lift-1"
FUNCTIONS = {
    "buildarena_simulation.simulate": (simulate, "engine"),
    "buildarena.simulate": (ba.simulate, "engine"),
    "buildarena.simulate_all": (ba.simulate_all, "engine"),
    "try_machine": (try_machine, "simulator"),
    "TrialPool.try_machine": (TrialPool.try_machine, "simulator"),
    "Environment": (Environment, "simulator"),
    "Evaluator": (Evaluator, "simulator"),
}


def test_a_function_takes_the_default_engine(subtests) -> None:
    for door in FUNCTIONS:
        with subtests.test(door=door):
            function, name = FUNCTIONS[door]
            assert inspect.signature(function).parameters[name].default == DEFAULT_ENGINE


def test_a_request_means_the_default_engine(subtests) -> None:
    for model in [JobSpec, SweepSpec, OpenSession, TrialQuery]:
        with subtests.test(model=model):
            assert model.model_fields["simulator"].default == DEFAULT_ENGINE


@pytest.fixture
def missing(monkeypatch):
    """An installation without the default engine."""
    monkeypatch.setattr(rollout, "ENGINES", ("mujoco",))


REFUSED = "'pybullet' is not installed: `pip install pybullet`, or name another; there are mujoco"


@pytest.mark.usefixtures("missing")
def test_where_it_is_missing_a_function_says_how_to_get_it(subtests) -> None:
    for ask in [
        lambda machine, task: simulate(machine, task.scenario),
        ba.simulate,
        lambda machine, task: ba.simulate_all([machine], task),
        lambda _, task: Environment(task),
        lambda _, task: Evaluator(task),
    ]:
        with subtests.test(ask=ask), pytest.raises(UnknownEngineError, match=REFUSED):
            ask(Machine(), builtin_tasks()[TASK])


@pytest.mark.usefixtures("missing")
def test_where_it_is_missing_the_command_line_says_how_to_get_it(tmp_path) -> None:
    machine = Machine()
    machine.act("start", {"init_shift": [0, 0, 0], "init_rotation": [0, 0, 0]})
    file = tmp_path / "machine.json"
    file.write_text(json.dumps(machine.to_document()))
    asked = CliRunner().invoke(app, ["machine", "simulate", str(file), "--task", TASK])
    assert asked.exit_code != 0
    assert "pip install pybullet" in asked.output + asked.stderr
