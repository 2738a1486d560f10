"""Whoever names no engine gets the same one, at every door; one that is missing is refused."""

import inspect

import pytest

import buildarena as ba
from buildarena_api.routes.machines import TrialQuery
from buildarena_api.routes.sessions import OpenSession
from buildarena_backend.catalog.specs import JobSpec, SweepSpec
from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.environment import Environment, Evaluator, TrialPool, try_machine
from buildarena_geometry import Machine
from buildarena_simulation import DEFAULT_ENGINE, UnknownEngineError, rollout, simulate


def test_whoever_names_no_engine_means_the_default_one() -> None:
    for function in (simulate, ba.simulate, ba.simulate_all):
        assert inspect.signature(function).parameters["engine"].default == DEFAULT_ENGINE
    for door in (try_machine, TrialPool.try_machine, Environment, Evaluator):
        assert inspect.signature(door).parameters["simulator"].default == DEFAULT_ENGINE
    for model in (JobSpec, SweepSpec, OpenSession, TrialQuery):
        assert model.model_fields["simulator"].default == DEFAULT_ENGINE


def test_where_it_is_missing_everybody_is_told_how_to_get_it(monkeypatch) -> None:
    monkeypatch.setattr(rollout, "ENGINES", ("mujoco",))
    task = builtin_tasks()["lift-1"]
    refused = "'pybullet' is not installed: `pip install pybullet`, or name another; there are muj"
    for ask in (
        lambda: simulate(Machine(), task.scenario),
        lambda: ba.simulate(Machine(), task),
        lambda: ba.simulate_all([Machine()], task),
        lambda: Environment(task),
        lambda: Evaluator(task),
    ):
        with pytest.raises(UnknownEngineError, match=refused):
            ask()
