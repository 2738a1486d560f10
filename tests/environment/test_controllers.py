"""Controllers in episodes: offered where the task has senses, read before they are taken."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from buildarena_benchmark import load_task
from buildarena_environment import Environment
from buildarena_geometry import Machine

EXAMPLE = Path(__file__).parents[2] / "examples" / "control"
PROGRAM = (EXAMPLE / "to-the-mark.lua").read_text(encoding="utf-8")


@pytest.fixture
def environment() -> Environment:
    return Environment(load_task(EXAMPLE / "to-the-mark.yaml"), "mujoco")


def built(environment: Environment) -> None:
    """Makes the calls by which the example's car was built."""
    document = json.loads((EXAMPLE / "car.machine.json").read_text(encoding="utf-8"))
    for made in Machine.from_document(document).log:
        assert environment.step(made.name, made.arguments).ok


def test_an_episode_with_a_program_is_scored(environment) -> None:
    seen = environment.reset()
    assert "set_controller" in [tool.name for tool in seen.tools]
    for words in ("control(t, sense)", "sense.marks[name]", "What you sense is 0.04 s old"):
        assert words in seen.briefing
    assert "sense.joints" not in seen.briefing
    built(environment)
    step = environment.step("set_controller", {"program": PROGRAM})
    assert (step.ok, step.feedback) == (
        True,
        f"The controller is set: {len(PROGRAM.splitlines())} lines. No key press is played.",
    )
    kept = environment.state()
    assert environment.step("set_controller", {"program": ""}).ok
    environment.restore(kept)
    assert environment.submitted().controller == PROGRAM
    assert environment.submit().trial.score.success


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"program": "function control("}, "Not set: the controller failed, line 1"),
        ({"program": "while true do end"}, "100,000 instructions"),
        ({"program": "x" * 70_000}, "at most 65,536 are read"),
        ({"program": 5}, "program must be a text, not 5"),
        ({"program": "\x00"}, "line 1: unexpected symbol"),
        ({}, "Missing: program"),
        (None, "Missing: program"),
        ("x", "an object of arguments"),
        ({"program": PROGRAM, "language": "lua"}, 'There is no argument "language"'),
    ],
)
def test_what_cannot_act_is_refused_and_changes_nothing(environment, arguments, words) -> None:
    environment.reset()
    environment.step("start")
    assert environment.step("set_controller", {"program": PROGRAM}).ok
    step = environment.step("set_controller", arguments)
    assert not step.ok
    assert words in step.feedback
    assert environment.submitted().controller == PROGRAM


def test_a_task_without_senses_has_no_such_tool() -> None:
    environment = Environment("transport-1")
    seen = environment.reset()
    assert "set_controller" not in [tool.name for tool in seen.tools]
    environment.step("start")
    for name in ("set_controller", "SET_CONTROLLER"):
        step = environment.step(name, {"program": PROGRAM})
        assert not step.ok
        assert "takes keys alone" in step.feedback
    assert environment.submitted().controller == ""


def test_a_program_that_fails_in_its_trial_is_a_failure_of_the_machine(environment) -> None:
    environment.reset()
    built(environment)
    program = "function control(t, sense) return { spinning = 1 } end"
    assert environment.step("set_controller", {"program": program}).ok
    done = environment.submit()
    assert (done.trial.reason, done.trial.counts) == ("controller_failed", False)
    assert "there is no action 'spinning'; there is spinning_" in done.report
