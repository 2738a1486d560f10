"""Variants of sessions: closed loops, packs, modules that are looked up, given machines."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.repairs import faulty
from support.providers.scripted import Recording, Scripted, call

from buildarena_backend.errors import PermanentError, StartupError
from buildarena_backend.replays.from_turns import replay_of_turns
from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.families.initial_machine import edits_between
from buildarena_geometry import LOOKUP, Machine, module_set, tool_definitions
from buildarena_simulation import simulate
from buildarena_worker.session.messages import Completion, Request
from buildarena_worker.session.results import Failed
from buildarena_worker.workflow import Workflows
from buildarena_worker.workflow.phases import MAX_LOOKUPS

START = call("start", init_shift=[0, 0, 0], init_rotation=[0, 0, 0], note="")
BLOCK = call("attach_block_to", base_block="1", face="A", new_block="Small Wooden Block", note="")
DONE = Completion(text="TERMINATE")
CROSS = [START, BLOCK, DONE]


def text_of(request: Request) -> str:
    return "\n".join(message.text for message in request.messages)


def test_a_failed_round_is_followed_by_one_that_is_reported_the_result(play, rollout) -> None:
    model = Scripted(*CROSS, *CROSS)
    failed = rollout(0, success=False, indicator=12.5)
    played = play(workflow="builder", client=model, loop={"rounds": 3}, rollouts=[failed])
    assert played.suspended is not None
    assert (played.suspended.number, played.suspended.final) == (1, False)
    assert "12.50" not in text_of(model.requests[0])
    told = text_of(model.requests[3])
    assert "It did not succeed. " in told
    assert "Load: 12.50 mass units." in told


def test_a_loop_ends_with_the_first_success(play, rollout) -> None:
    records = [rollout(0, success=False, indicator=1.0), rollout(1, indicator=9.0)]
    model = Scripted(*CROSS, *CROSS)
    played = play(workflow="builder", client=model, loop={"rounds": 5}, rollouts=records)
    assert played.end.best is records[1]


def test_the_last_round_is_final(play, rollout) -> None:
    model, failed = Scripted(*CROSS, *CROSS), rollout(0, success=False)
    played = play(workflow="builder", client=model, loop={"rounds": 2}, rollouts=[failed])
    assert played.suspended.final


def test_a_round_without_a_machine_is_followed_by_another(play) -> None:
    objection = call("raise_objection", reason="too hard")
    model = Scripted(objection, *CROSS)
    played = play(workflow="builder", client=model, loop={"rounds": 2})
    assert played.suspended is not None
    assert "Round 1 produced no machine: builder: too hard." in text_of(model.requests[1])


def test_rounds_without_any_machine_fail(play) -> None:
    model = Scripted(last=call("raise_objection", reason="no"))
    played = play(workflow="builder", client=model, loop={"rounds": 2})
    assert isinstance(played.failure, Failed)
    assert len(played.entries) == 2


def test_an_analyst_looks_and_its_advice_reaches_the_next_round(play, rollout) -> None:
    machine = Machine()
    for reply in (START, BLOCK):
        machine.act(reply.calls[0].name, reply.calls[0].arguments)
    trajectory = simulate(machine, builtin_tasks()["support-1"].scenario, "mujoco")
    record = rollout(0, success=False)
    object.__setattr__(record, "trajectory_hash", "t")
    looks = [
        call("read_trajectory", block="cargo", from_s=0, to_s=2),
        call("read_trajectory", block="99", from_s=0, to_s=2),
        call("read_trajectory", block="1"),
        call("read_transcript", first_turn=0),
        call("read_breaks"),
        call("get_machine_summary"),
        call("attach_block_to", base_block="1", face="B", new_block="Torch", note=""),
    ]
    model = Scripted(*CROSS, *looks, Completion(text="Make it longer than the gap."), *CROSS)
    loop, trials = {"rounds": 2, "analyst": True}, {"t": trajectory}
    given = {"loop": loop, "rollouts": [record], "trajectories": trials}
    played = play(workflow="builder", client=model, **given)
    assert played.suspended is not None, played.failure
    actions = [a for t in played.session.transcript.turns if t.role == "analyst" for a in t.actions]
    assert actions[0].feedback.startswith("0.00, 0.00, 0.00, ")
    assert "There is no block '99'" in actions[1].feedback
    assert actions[2].reason == "malformed_arguments"
    assert "[builder]" in actions[3].feedback
    assert actions[5].ok
    assert actions[6].reason == "unknown_action"
    last = text_of(model.requests[-1])
    assert "Make it longer than the gap." in last


def test_one_shot_shows_an_example_that_zero_shot_does_not(play) -> None:
    shown, plain = Scripted(*CROSS), Scripted(*CROSS)
    play(workflow="builder", client=shown, loop={"one_shot": True})
    play(workflow="builder", client=plain)
    assert "## Example" in text_of(shown.requests[0])
    assert "## Example" not in text_of(plain.requests[0])
    assert shown.requests[0].hash != plain.requests[0].hash


OWN = '''
from buildarena_worker.workflow.phases import Builder

class Twice:
    """Builds alone, after thinking aloud."""

    name = "twice"

    def build(self, session):
        return Builder().build(session)
'''


def test_an_operators_workflow_is_loaded_by_path(play, tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(OWN)
    workflows = {"twice": f"{file}:Twice"}
    played = play(workflow="twice", workflows=workflows, client=Scripted(*CROSS))
    assert played.suspended is not None, played.failure


def test_a_workflow_that_cannot_be_loaded_is_named(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text("raise RuntimeError('no')")
    with pytest.raises(StartupError, match=r"workflow .own. can.t be loaded .* no"):
        Workflows({"own": f"{file}:Own"})
    with pytest.raises(PermanentError, match="unknown workflow 'other'; valid workflows: five"):
        Workflows({}).find("other")


LOOKUPS = {tool.name for tool in tool_definitions([LOOKUP])}
HINGE = module_set("workshop")["Hinge"]


def task(how, modules="workshop"):
    given = builtin_tasks()["transport-1"]
    update = {"modules": modules, "module_list": how}
    return replace(given, constraints=given.constraints.model_copy(update=update))


def test_the_expert_plays_as_well_where_it_looks_up(play, subtests):
    for workflow in ["five-role", "guidance-builder", "builder"]:
        with subtests.test(workflow=workflow):
            machines = {}
            for how in ("inline", "on_demand"):
                model = Recording()
                played = play(task=task(how), client=model, workflow=workflow)
                assert played.suspended is not None, played.failure
                machines[how] = played.session.machine
                held = {tool.name for request in model.requests for tool in request.tools}
                assert held >= LOOKUPS if how == "on_demand" else not held & LOOKUPS
                told = any(HINGE.description in text_of(request) for request in model.requests)
                assert told == (how == "inline")
            assert machines["inline"] == machines["on_demand"]


def test_a_role_that_only_looks_up_comes_to_its_end(play):
    model = Scripted(last=call("list_modules", category="basic"))
    played = play(task=task("on_demand"), client=model)
    assert played.failure.reason == "plan_unreadable"
    assert len(model.requests) == 5 * (1 + MAX_LOOKUPS)


def test_a_lookup_that_is_refused_says_what_there_is(play):
    model = Scripted(
        call("list_modules", category="gears"),
        call("describe_module", module="Hinje, Swivel"),
        call("describe_module", module="hinge, SWIVEL"),
    )
    played = play(task=task("on_demand"), client=model, workflow="builder")
    turns = played.session.transcript.turns
    answers = [action.feedback for turn in turns for action in turn.actions]
    assert answers[0].startswith('There is no category "gears". Categories: basic, locomotion')
    assert '"Hinje"' in answers[1]
    assert "Hinge" in answers[1].partition("Modules: ")[2]
    assert HINGE.description in answers[2]
    assert module_set("workshop")["Swivel"].description in answers[2]


def test_further_types_are_built_and_replayed(play):
    attach = {"base_block": "1", "face": "A", "new_block": "Hinge"}
    calls = [call("attach_block_to", **attach)]
    calls.append(call("attach_block_to", **{**attach, "face": "B", "new_block": "Rocket"}))
    model = Scripted(call("start"), *calls, Completion(text="TERMINATE"))
    played = play(task=task("told"), client=model, workflow="builder")
    turns = played.session.transcript.turns
    assert [turn.actions[0].ok for turn in turns[:3]] == [True, True, False]
    assert "Rocket" not in turns[2].actions[0].feedback.partition("Modules: ")[2]
    again = replay_of_turns(json.loads(played.session.transcript.to_json())["turns"])
    assert again.complete
    assert [block.module.name for block in again.machine.blocks.values()][1:] == ["Hinge"]


def test_builders_begin_with_the_machine_of_the_seed_and_nobody_drives(play, subtests) -> None:
    for workflow in ["five-role", "builder", "guidance-builder"]:
        for seed in [0, 9]:
            with subtests.test(workflow=workflow, seed=seed):
                played = play("builtin/expert", task="repair-1", seed=seed, workflow=workflow)
                assert played.suspended is not None, played.failure
                task = builtin_tasks()["repair-1"].with_seed(seed)
                assert edits_between(faulty(task), played.suspended.machine) == 5
                assert played.suspended.controls is None
                assert all(turn.role != "controller" for turn in played.session.transcript.turns)


def test_those_without_tools_are_told_the_machine(play) -> None:
    played = play("builtin/expert", task="repair-1", seed=3)
    task = builtin_tasks()["repair-1"].with_seed(3)
    summary = faulty(task).act("get_machine_summary", {}).text
    assert summary in played.session.statement
    assert "UpArrow" in played.session.statement
    assert summary not in play("builtin/expert", task="repair-1", seed=4).session.statement
