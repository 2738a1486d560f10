"""Sessions whose modules are looked up: what roles hold and read, and what comes of it."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from support.providers.scripted import Recording, Scripted, call

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import LOOKUP, module_set, tool_definitions
from buildarena_pipeline.replays.from_turns import replay_of_turns
from buildarena_worker.session.messages import Completion
from buildarena_worker.workflow.phases import MAX_LOOKUPS

LOOKUPS = {tool.name for tool in tool_definitions([LOOKUP])}
HINGE = module_set("workshop")["Hinge"]


def task(how, modules="workshop"):
    given = builtin_tasks()["transport-1"]
    update = {"modules": modules, "module_list": how}
    return replace(given, constraints=given.constraints.model_copy(update=update))


def texts(request):
    return "\n".join(message.text for message in request.messages)


@pytest.mark.parametrize("workflow", ["five-role", "guidance-builder", "builder"])
def test_the_expert_plays_as_well_where_it_looks_up(play, workflow):
    machines = {}
    for how in ("inline", "on_demand"):
        model = Recording()
        played = play(task=task(how), client=model, workflow=workflow)
        assert played.suspended is not None, played.failure
        machines[how] = played.session.machine
        held = {tool.name for request in model.requests for tool in request.tools}
        assert held >= LOOKUPS if how == "on_demand" else not held & LOOKUPS
        told = any(HINGE.description in texts(request) for request in model.requests)
        assert told == (how == "inline")
    assert machines["inline"] == machines["on_demand"]


def test_what_one_role_looks_up_no_other_reads(play):
    model = Recording()
    played = play(task=task("on_demand"), client=model)
    wheel = module_set("workshop")["Powered Wheel"].description
    readers = {
        turn.role
        for turn, request in zip(played.session.transcript.turns, model.requests, strict=True)
        if wheel in texts(request) and turn.role != "controller"
    }
    # The controller is told of what it drives, whatever was looked up.
    assert readers == {"planner", "drafter"}


def test_builders_that_only_carry_out_have_no_lookups(play):
    model = Recording()
    played = play(task=task("on_demand"), client=model)
    for turn, request in zip(played.session.transcript.turns, model.requests, strict=True):
        held = {tool.name for tool in request.tools} & LOOKUPS
        assert held == (
            LOOKUPS if turn.role in ("planner", "drafter", "reviewer", "guidance") else set()
        )


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
    answers = [
        action.feedback for turn in played.session.transcript.turns for action in turn.actions
    ]
    assert answers[0].startswith('There is no category "gears". Categories: basic, locomotion')
    assert '"Hinje"' in answers[1]
    assert "Hinge" in answers[1].partition("Modules: ")[2]
    assert HINGE.description in answers[2]
    assert module_set("workshop")["Swivel"].description in answers[2]


def test_a_told_session_has_no_such_tools(play):
    model = Scripted(call("list_modules", category="basic"))
    played = play(task=task("told"), client=model, workflow="builder")
    action = played.session.transcript.turns[0].actions[0]
    assert (action.ok, action.reason) == (False, "unknown_action")


def test_further_types_are_built_and_replayed(play):
    attach = {"base_block": "1", "face": "A", "new_block": "Hinge"}
    model = Scripted(
        call("start"),
        call("attach_block_to", **attach),
        call("attach_block_to", **{**attach, "face": "B", "new_block": "Rocket"}),
        Completion(text="TERMINATE"),
    )
    played = play(task=task("told"), client=model, workflow="builder")
    turns = played.session.transcript.turns
    assert [turn.actions[0].ok for turn in turns[:3]] == [True, True, False]
    assert "Rocket" not in turns[2].actions[0].feedback.partition("Modules: ")[2]
    again = replay_of_turns(json.loads(played.session.transcript.to_json())["turns"])
    assert again.complete
    assert [block.module.name for block in again.machine.blocks.values()][1:] == ["Hinge"]
