"""Episodes played by calls as models make them, also where a machine is given."""

import json
from dataclasses import replace

import pytest
from support.machines.expert_calls import calls_of, played

from buildarena_benchmark import builtin_tasks, parse_task
from buildarena_benchmark.environment import (
    ASSEMBLY,
    Environment,
    EpisodeOverError,
    Limits,
    call,
    call_text,
)
from buildarena_benchmark.environment.calls import parse_call
from buildarena_benchmark.environment.errors import CallError
from buildarena_benchmark.environment.options import reference_of
from buildarena_benchmark.environment.trials.trial_pool import WrittenTask
from buildarena_benchmark.families.initial_machine import edits_between
from buildarena_simulation import SimulationError

START = json.dumps({"tool": "start", "arguments": {}})


SUBMIT = json.dumps({"tool": "submit"})


def as_text(made: dict) -> str:
    arguments = {**made["arguments"], "machine": made["machine"]}
    return json.dumps({"tool": made["tool"], "arguments": arguments})


def test_the_experts_calls_as_text_earn_what_they_earn_as_steps(experts) -> None:
    task = "lift-3"
    rewards = {"indicator": 1.0, "constraint_progress": 0.1}
    environment = Environment(task, simulator="mujoco", rewards=rewards)
    answers = [call_text(environment, as_text(made)) for made in experts[task]["calls"]]
    assert all(answer.accepted for answer in answers)
    assert not any(answer.terminated or answer.truncated for answer in answers)
    tests = [call_text(environment, SUBMIT) for _ in range(3)]
    assert not any(test.terminated for test in tests)
    # The last test trial is in its own world; the trial that counts is in the exact one.
    first, _, third = (test.trial.score.indicator for test in tests)
    last = call_text(environment, SUBMIT)
    assert (last.terminated, last.truncated, environment.done) == (True, False, True)
    assert last.trial.score.indicator == first != third
    told = experts[task]["score"]["indicator"]
    assert last.trial.score.indicator == pytest.approx(told, rel=1e-6)
    assert sum(answer.gained for answer in [*answers, *tests, last]) == pytest.approx(last.reward)
    assert last.reward == pytest.approx(1.1, rel=1e-4)
    with pytest.raises(EpisodeOverError):
        call_text(environment, START)


NONSENSE = [
    ("", "not valid JSON"),
    ("start", "not valid JSON"),
    ("[" * 100_000, "not valid JSON"),
    ('{"tool": ' + "9" * 5000 + "}", "not valid JSON"),
    ("[]", "a call is an object"),
    ('{"name": "start"}', "no 'name': choose from tool, arguments"),
    ('{"tool": ["start"]}', "'tool' is a tool's name"),
    ('{"tool": "start", "arguments": []}', "'arguments' are an object"),
    ('{"tool": "start", "arguments": {"machine": 5}}', "'machine' is a name, not int"),
    ('{"tool": "start", "arguments": {"machine": "a b"}}', "letters, digits"),
    ('{"tool": "submit", "arguments": {"now": true}}', "There is no argument 'now'"),
    ('{"tool": "submit"}', "there is no machine to simulate"),
    ('{"tool": "\\u0000"}', ""),
    ('{"tool": "fly", "arguments": {"up": NaN}}', "fly"),
]


def test_nonsense_is_answered_and_counts_as_a_step() -> None:
    for text, said in NONSENSE:
        environment = Environment("support-1", limits=Limits(steps=3))
        answer = call_text(environment, text)
        assert said in answer.text
        assert (answer.accepted, answer.terminated, answer.trial) == (False, False, None)
        assert environment.remaining_steps == 2


def test_text_that_is_no_call_says_how_one_looks() -> None:
    with pytest.raises(CallError, match=r'write \{"tool": "start", "arguments": \{\}\}'):
        parse_call("let us begin")
    assert parse_call('{"tool": "start"}', longest=17) == ("start", {})
    with pytest.raises(CallError, match="the call has 17 characters: at most 16 are read"):
        parse_call('{"tool": "start"}', longest=16)
    environment = Environment("support-1")
    assert "at most 10 are read" in call_text(environment, START, longest=10).text
    assert environment.remaining_steps == 1999


def test_the_last_call_submits_what_there_is() -> None:
    for last in (START, "nonsense", '{"tool": "submit", "arguments": 1}'):
        environment = Environment("support-1", limits=Limits(steps=2))
        arguments = {"machine": "left"}
        call(environment, "start", arguments)
        assert arguments == {"machine": "left"}
        answer = call_text(environment, last)
        assert (answer.truncated, answer.terminated, environment.done) == (True, False, True)
        assert "That was the last call" in answer.text
        assert answer.trial.reason in ("empty_machine", "nothing_submitted")


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
    assert environment.remaining_steps == 1
    with pytest.raises(SimulationError):
        call(environment, "start")
    assert (environment.remaining_steps, environment.done) == (0, False)
    answer = call_text(environment, "whatever")
    assert (answer.truncated, environment.done, answer.trial.score.success) == (True, True, False)


REPAIR = "repair-1"


LOOK = "get_machine_summary"


def test_the_seed_draws_the_machine_that_stands_there() -> None:
    summaries = [Environment(REPAIR, seed=seed).step(LOOK).feedback for seed in (None, 0, 1, 2)]
    assert summaries[0] == summaries[1]
    assert len(set(summaries)) == 3
    environment = Environment(REPAIR)
    environment.reset(seed=2)
    assert environment.step(LOOK).feedback == summaries[3]
    environment.reset()
    assert environment.step(LOOK).feedback == summaries[3]


def test_an_edit_too_many_is_refused_with_the_number_and_changes_nothing() -> None:
    environment = Environment(REPAIR, seed=1)
    assert environment.step(LOOK).ok
    machine = environment.machines["main"]
    given = machine.copy()
    wheels = [block.id for block in machine.blocks.values() if block.module.spins]
    other = {"action": "spinning_forward", "new_key": "Alpha9"}
    for wheel in wheels:
        assert environment.step("flip_spin", {"block_id": wheel}).ok
    assert environment.step("change_control_key", {"block_id": wheels[0], **other}).ok
    before, further = machine.copy(), {"block_id": wheels[1], **other}
    refused = environment.step("change_control_key", further)
    assert not refused.ok
    assert "by 7 edits, the task allows 6" in refused.feedback
    assert machine == before
    assert environment.step("flip_spin", {"block_id": wheels[0]}).ok, "undone"
    assert environment.step("change_control_key", further).ok
    assert edits_between(given, machine) == 6


def test_neither_a_new_beginning_nor_other_presses_nor_copies_are_taken() -> None:
    environment = Environment(REPAIR)
    environment.step(LOOK)
    given = environment.machines["main"].copy()
    for tool, arguments, machine in (
        ("reset", {}, "main"),
        ("add_control_sequence", {"time": 1, "key": "UpArrow", "hold_for": 1}, "main"),
        ("reset_control_sequence", {}, "main"),
        ("remove_control_sequence", {"index": 0}, "main"),
        ("add_machine", {"machine_id": "main"}, ASSEMBLY),
    ):
        assert not environment.step(tool, arguments, machine=machine).ok
        assert environment.machines["main"] == given


def test_the_seeds_own_repair_succeeds_and_anothers_does_not() -> None:
    done = played(Environment(REPAIR, simulator="mujoco", seed=5), calls_of(REPAIR, 5)).submit()
    assert (done.trial.score.success, done.trial.score.indicator) == (True, 1.0)
    other = Environment(REPAIR, simulator="mujoco", seed=6)
    for made in calls_of(REPAIR, 5):
        other.step(made["tool"], made["arguments"], machine=made["machine"])
    assert not other.submit().trial.score.success


def test_a_drawn_task_comes_through_text_as_it_is() -> None:
    known = builtin_tasks()[REPAIR]
    own = replace(known, name="own-repair")
    for task in (known, known.with_seed(7), own, own.with_seed(8), builtin_tasks()["support-1"]):
        again = WrittenTask.of(task).parse()
        drawn = (task.name, task.seed, task.initial_machine)
        assert (again.name, again.seed, again.initial_machine) == drawn
    assert parse_task(WrittenTask.of(own).text, origin="x").version == known.version
    assert reference_of(known.with_seed(7)) == reference_of(known)
