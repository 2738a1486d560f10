"""Controllers in episodes: offered where the task has senses, read before they are taken."""

import json
from pathlib import Path

import pytest

from buildarena_benchmark import load_task
from buildarena_benchmark.environment import Environment
from buildarena_geometry import Machine

EXAMPLE = Path(__file__).parents[3] / "examples" / "control"
PROGRAM = (EXAMPLE / "to-the-mark.lua").read_text(encoding="utf-8")


@pytest.fixture
def environment() -> Environment:
    return Environment(load_task(EXAMPLE / "to-the-mark.yaml"), "mujoco")


def built(environment: Environment) -> None:
    """Makes the calls by which the example's car was built."""
    document = json.loads((EXAMPLE / "car.machine.json").read_text(encoding="utf-8"))
    for made in Machine.from_document(document).log.records:
        assert environment.step(made.name, made.arguments).ok


def test_an_episode_with_a_program_is_scored(environment) -> None:
    seen = environment.reset()
    assert "set_controller" in [tool.name for tool in seen.tools]
    for words in ("control(t, sense)", "sense.marks[name]", "Senses are 0.04 s old"):
        assert words in seen.briefing
    assert "sense.joints" not in seen.briefing
    built(environment)
    step = environment.step("set_controller", {"program": PROGRAM})
    told = f"The controller is set: {len(PROGRAM.splitlines())} lines. No key press is played."
    assert (step.ok, step.feedback) == (True, told)
    kept = environment.state()
    assert environment.step("set_controller", {"program": ""}).ok
    environment.restore(kept)
    assert environment.submitted().controller == PROGRAM
    feedback = environment.step("test_controller").feedback
    done = environment.submit().trial
    assert done.score.success
    piloting = done.trajectory.piloting
    for name, level in zip(piloting.action_names, piloting.answers[0], strict=True):
        assert not level or f"{name} {level:.3g}" in feedback, "what it would do is what it does"


UNFIT = [
    ({"program": "function control("}, "Not set: the controller failed, line 1"),
    ({"program": "while true do end"}, "100,000 instructions"),
    ({"program": "x" * 70_000}, "at most 65,536 are read"),
    ({"program": 5}, "program must be a text, not 5"),
    ({"program": "\x00"}, "line 1: unexpected symbol"),
    ({}, "Missing: program"),
    ({"program": PROGRAM, "language": "lua"}, 'There is no argument "language"'),
]


def test_what_cannot_act_is_refused_and_changes_nothing(environment) -> None:
    environment.reset()
    environment.step("start")
    assert environment.step("set_controller", {"program": PROGRAM}).ok
    for arguments, words in UNFIT:
        step = environment.step("set_controller", arguments)
        assert (step.ok, words in step.feedback) == (False, True), step.feedback
        assert environment.submitted().controller == PROGRAM


def test_a_task_without_senses_has_no_such_tools() -> None:
    environment = Environment("transport-1")
    seen = environment.reset()
    assert not {"set_controller", "test_controller"} & {tool.name for tool in seen.tools}
    environment.step("start")
    for name in ("set_controller", "SET_CONTROLLER", "test_controller"):
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


NAN = float("nan")
LOOKING = """
local seen = 0
function control(t, sense)
  seen = seen + 1
  return { spinning_forward = sense.marks.goal.relative.y > 1 and seen / 4 or 0 }
end
"""


def test_a_program_is_asked_without_a_trial(environment) -> None:
    environment.reset()
    built(environment)
    machine = environment.submitted().to_document()
    assert environment.step("test_controller").feedback.startswith("There is no program yet")
    assert environment.step("set_controller", {"program": LOOKING}).ok
    alone = environment.step("test_controller")
    goal = environment.task.scenario.marks[0].center
    assert alone.ok
    assert f"t 0 s: it senses marks.goal.relative.y {goal[1]:g} and does" in alone.feedback
    assert "spinning_forward 0.25" in alone.feedback
    ticks = [{}, {"t": 1.5, "marks.goal.relative.y": 0.5}, {"marks.goal.relative.y": 20}, {}]
    first, second, third, fourth = environment.step(
        "TEST_CONTROLLER", {"ticks": ticks}
    ).feedback.splitlines()
    assert "spinning_forward 0.25" in first
    assert second == "t 1.5 s: it senses marks.goal.relative.y 0.5 and does nothing."
    assert third.startswith("t 1.54 s: it senses marks.goal.relative.y 20 and does")
    assert "spinning_forward 0.75" in third
    assert "spinning_forward 1" in fourth
    assert environment.step("set_controller", {"program": ""}).ok
    assert environment.submitted().to_document()["blocks"] == machine["blocks"]


FAR = "function control() for k = 1, 24000 do end return {} end"
WRONG = [
    *((LOOKING, {"ticks": ticks}, "at most 20 objects") for ticks in ([], [{}] * 21)),
    (LOOKING, {"ticks": "now"}, "ticks is not of the type array"),
    (LOOKING, {"ticks": [3]}, "ticks[0] is no object"),
    *((LOOKING, {"ticks": [{"t": t}]}, "[0].t is no number") for t in ("1", NAN, True, 10**400)),
    (LOOKING, {"ticks": [{"marks.gaol.x": 2}]}, "there is no sense 'marks.gaol.x'; there is "),
    ("function control() return { spinning = 1 } end", {}, "there is no action 'spinning'"),
    ("function control() error('lost') end", {}, "line 1"),
    (FAR, {"ticks": [{}] * 20}, "t 0.76 s"),
]


def test_a_test_that_goes_wrong_says_why(environment) -> None:
    environment.reset()
    built(environment)
    for program, arguments, words in WRONG:
        assert environment.step("set_controller", {"program": program}).ok
        step = environment.step("test_controller", arguments)
        assert step.ok == words.startswith("t 0")
        assert words in step.feedback
