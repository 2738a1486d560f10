"""Episodes played by tool calls as models make them, whatever they make."""

from __future__ import annotations

import json

import pytest

from buildarena_environment import (
    CallError,
    Environment,
    EpisodeOverError,
    Limits,
    call,
    call_text,
    read_call,
)
from buildarena_simulation import SimulationError

START = json.dumps({"tool": "start", "arguments": {}})
SUBMIT = json.dumps({"tool": "submit"})


def as_text(made: dict) -> str:
    arguments = {**made["arguments"], "machine": made["machine"]}
    return json.dumps({"tool": made["tool"], "arguments": arguments})


@pytest.mark.ci
@pytest.mark.parametrize("task", ["support-1", "lift-3"])
def test_the_experts_calls_as_text_earn_what_they_earn_as_steps(experts, task) -> None:
    rewards = {"indicator": 1.0, "constraint_progress": 0.1}
    environment = Environment(task, simulator="mujoco", rewards=rewards)
    answers = [call_text(environment, as_text(made)) for made in experts[task]["calls"]]
    assert all(answer.accepted for answer in answers)
    assert not any(answer.terminated or answer.truncated for answer in answers)
    last = call_text(environment, SUBMIT)
    assert (last.terminated, last.truncated, environment.done) == (True, False, True)
    assert last.trial.score.indicator == pytest.approx(
        experts[task]["score"]["indicator"], rel=1e-6
    )
    assert sum(answer.gained for answer in [*answers, last]) == pytest.approx(last.reward)
    assert last.reward == pytest.approx(1.1, rel=1e-4)
    with pytest.raises(EpisodeOverError):
        call_text(environment, START)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not valid JSON"),
        ("start", "not valid JSON"),
        ("[" * 100_000, "not valid JSON"),
        ('{"tool": ' + "9" * 5000 + "}", "not valid JSON"),
        ("[]", "a call is an object"),
        ("null", "a call is an object"),
        ('{"name": "start"}', "no 'name': choose from tool, arguments"),
        ('{"tool": ["start"]}', "'tool' is a tool's name"),
        ('{"arguments": {}}', "'tool' is a tool's name"),
        ('{"tool": "start", "arguments": []}', "'arguments' are an object"),
        ('{"tool": "start", "arguments": null}', "'arguments' are an object"),
        ('{"tool": "start", "arguments": {"machine": 5}}', "'machine' is a name, not int"),
        ('{"tool": "start", "arguments": {"machine": ["a"]}}', "'machine' is a name, not list"),
        ('{"tool": "start", "arguments": {"machine": "a b"}}', "letters, digits"),
        ('{"tool": "submit", "arguments": {"now": true}}', "'submit' takes no arguments"),
        ('{"tool": "submit"}', "there is no machine to simulate"),
        ('{"tool": "\\u0000"}', ""),
        ('{"tool": "fly", "arguments": {"up": NaN}}', "fly"),
    ],
)
def test_nonsense_is_answered_and_counts_as_a_step(text, said) -> None:
    environment = Environment("support-1", limits=Limits(steps=3))
    answer = call_text(environment, text)
    assert said in answer.text
    assert (answer.accepted, answer.terminated, answer.trial) == (False, False, None)
    assert environment.steps_left == 2


def test_text_that_is_no_call_says_how_one_looks() -> None:
    with pytest.raises(CallError, match=r'write \{"tool": "start", "arguments": \{\}\}'):
        read_call("let us begin")
    assert read_call('{"tool": "start"}', longest=17) == ("start", {})
    with pytest.raises(CallError, match="the call has 17 characters: at most 16 are read"):
        read_call('{"tool": "start"}', longest=16)
    environment = Environment("support-1")
    assert "at most 10 are read" in call_text(environment, START, longest=10).text
    assert environment.steps_left == 1999


@pytest.mark.parametrize("last", [START, "nonsense", '{"tool": "submit", "arguments": 1}'])
def test_the_last_call_submits_what_there_is(last) -> None:
    environment = Environment("support-1", limits=Limits(steps=2))
    call(environment, "start", {"machine": "left"})
    answer = call_text(environment, last)
    assert (answer.truncated, answer.terminated, environment.done) == (True, False, True)
    assert "That was the last call" in answer.text
    assert answer.trial.reason in ("empty_machine", "nothing_submitted")


def test_arguments_are_left_as_they_were() -> None:
    arguments = {"machine": "left"}
    call(Environment("support-1"), "start", arguments)
    assert arguments == {"machine": "left"}


def test_a_simulator_that_fails_leaves_the_episode_open_for_another_try() -> None:
    failures = [SimulationError("gone"), SimulationError("gone")]
    real = Environment("support-1")._tries

    def failing(*asked, seed):
        if failures:
            raise failures.pop()
        return real(*asked, seed=seed)

    environment = Environment("support-1", limits=Limits(steps=2), tries=failing)
    call(environment, "start")
    with pytest.raises(SimulationError):
        call(environment, "submit")
    assert environment.steps_left == 1
    with pytest.raises(SimulationError):
        call(environment, "start")
    assert (environment.steps_left, environment.done) == (0, False)
    answer = call_text(environment, "whatever")
    assert (answer.truncated, environment.done, answer.trial.score.success) == (True, True, False)
