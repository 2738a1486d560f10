"""The tree workflows: machines from construction trees that roles write."""

from __future__ import annotations

import json

import pytest
from support.providers.scripted import Scripted
from support.providers.tree_engineer import TreeEngineer
from support.stages import work

from buildarena_benchmark import builtin_tasks, score
from buildarena_geometry import Machine, module_set
from buildarena_geometry.trees import POINTING, read_tree, tree_actions, tree_in
from buildarena_pipeline.catalog.prompt_packs import PromptPacks
from buildarena_pipeline.catalog.specs import JobSpec
from buildarena_pipeline.replays.from_document import replay_of_document
from buildarena_pipeline.replays.from_turns import replay_of_turns
from buildarena_simulation import ENGINES, simulate
from buildarena_worker.builtin import MODELS
from buildarena_worker.session.messages import Completion
from buildarena_worker.session.results import Failed
from buildarena_worker.wiring import verification_runner
from buildarena_worker.workflow.rounds import Loop
from buildarena_worker.workflow.tree_iterative import EDITS
from buildarena_worker.workflow.trees import TREE_TURNS

pytestmark = pytest.mark.nightly

SESSIONS = [
    ("tree-single", "transport-1"),
    ("tree-iterative", "support-1"),
    ("tree-hierarchical", "transport-1"),
]
DONE = Completion(text="TERMINATE")


def tree(*entries: dict[str, object]) -> Completion:
    root = {"type": 0, "id": 0, "parent": -1, "face_id": -1}
    return Completion(text=f"```json\n{json.dumps([root, *entries])}\n```")


def block(number: int, parent: int, point: int, kind: object = 15) -> dict[str, object]:
    return {"type": kind, "id": number, "parent": parent, "face_id": point}


SMALL = tree(block(1, 0, 0))
LARGE = tree(block(1, 0, 0), block(2, 1, 0))
BROKEN = tree(block(1, 0, 0), block(2, 7, 0))
FAULT = Completion(text="Too small.")


def parts(played) -> int:
    assert played.suspended is not None, played.failure
    return played.suspended.machine.part_count


def texts(model: Scripted, request: int) -> str:
    return "\n".join(message.text for message in model.requests[request].messages)


def placed(machine: Machine) -> list[object]:
    """The parts of a machine without the keys that a controller gave them."""
    blocks = [
        (block.id, block.module, block.mount, block.flipped, block.world_from_block)
        for block in machine.blocks.values()
    ]
    return [*blocks, *machine.connectors.values()]


def turns_of(played) -> list[dict]:
    return json.loads(played.session.transcript.to_json())["turns"]


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("workflow", "name"), SESSIONS)
def test_the_words_of_the_prompts_are_enough_for_a_success(play, workflow, name, engine) -> None:
    task = builtin_tasks()[name]
    played = play(client=TreeEngineer(), workflow=workflow, task=name)
    assert played.suspended is not None, played.failure
    machine, controls = played.suspended.machine, played.suspended.controls
    assert score(task, machine, simulate(machine, task.scenario, engine, controls=controls)).success


@pytest.mark.parametrize(("workflow", "name"), SESSIONS)
def test_a_session_that_was_killed_resumes_from_any_point_of_its_journal(
    play, workflow, name
) -> None:
    whole = play(client=TreeEngineer(), workflow=workflow, task=name)
    machine = whole.suspended.machine.to_document()
    for place in range(len(whole.entries)):
        model = TreeEngineer()
        resumed = play(client=model, workflow=workflow, task=name, entries=whole.entries[:place])
        assert resumed.suspended.machine.to_document() == machine
        assert len(model.requests) == len(whole.entries) - place
    replayed = play(offline=True, workflow=workflow, task=name, entries=whole.entries)
    assert replayed.suspended.machine.to_document() == machine


@pytest.mark.parametrize(("workflow", "name"), SESSIONS)
def test_trees_are_built_by_ordinary_actions_that_can_be_replayed(play, workflow, name) -> None:
    played = play(client=TreeEngineer(), workflow=workflow, task=name)
    turns = turns_of(played)
    names = {action["name"] for turn in turns for action in turn["actions"]}
    assert names <= {
        *("reset", "start", "attach_block_to", "connect_blocks", "twist_block", "flip_spin")
    }
    machine = played.session.machine
    for replay in (replay_of_turns(turns), replay_of_document(machine.to_document(), turns)):
        assert replay.complete
        assert [chapter.kind for chapter in replay.chapters] == ["machine"]
        assert placed(replay.machine) == placed(machine)


@pytest.mark.nightly(keep=1)
@pytest.mark.parametrize(("workflow", "name"), SESSIONS)
def test_a_job_of_a_tree_workflow_is_scored_and_verified(
    context, submissions, monkeypatch, workflow, name
) -> None:
    monkeypatch.setitem(MODELS, "expert", TreeEngineer().complete)
    spec = JobSpec(
        task=name, model="builtin/expert", simulator="mujoco", worlds=0, workflow=workflow
    )
    job, _ = submissions.submit_job(spec)
    work(context)
    job = context.store.jobs.get(job.id)
    assert (job.outcome, job.reason) == ("success", None)
    (check,) = context.store.verifications.request([job.id]).ids.values()
    while verification_runner(context).process_one():
        pass
    assert context.store.verifications.get(check).verdict == "verified"


@pytest.mark.parametrize("workflow", [workflow for workflow, _ in SESSIONS])
def test_a_model_that_writes_no_tree_fails(play, workflow) -> None:
    failure = play("builtin/idle", workflow=workflow).failure
    assert isinstance(failure, Failed)
    planned = workflow == "tree-hierarchical"
    assert failure.reason == ("plan_unreadable" if planned else "tree_invalid")


def test_a_tree_that_cannot_be_built_is_told_with_its_entry_and_written_again(play) -> None:
    model = Scripted(Completion(text="Well."), BROKEN, LARGE)
    played = play(client=model, workflow="tree-single")
    assert parts(played) == 3
    assert "there is no construction tree" in texts(model, 1)
    assert "entry 2 (type 15, line 1): parent 7 is not an earlier entry" in texts(model, 2)
    assert played.session.transcript.refusals == {}


def test_a_tree_whose_blocks_overlap_is_counted_as_a_refusal_and_begun_anew(play) -> None:
    wrong = tree(block(1, 0, 0), block(2, 0, 4), block(3, 1, 3), block(4, 2, 4))
    played = play(client=Scripted(wrong, SMALL), workflow="tree-single")
    assert parts(played) == 2
    assert played.session.transcript.refusals == {"overlap": 1}
    names = [action.name for action in played.session.transcript.turns[1].actions]
    assert names == ["reset", "start", "attach_block_to"]


def test_a_designer_has_a_few_turns_for_a_tree(play) -> None:
    model = Scripted(last=BROKEN)
    failure = play(client=model, workflow="tree-single").failure
    assert isinstance(failure, Failed)
    assert failure.reason == "tree_invalid"
    assert "entry 2" in failure.detail
    assert len(model.requests) == TREE_TURNS


def test_a_module_that_the_task_does_not_offer_is_refused(play) -> None:
    model = Scripted(tree(block(1, 0, 0, "Log")), SMALL)
    assert parts(play(client=model, workflow="tree-single")) == 2
    assert '"Log" can\'t be attached. Modules: Small Wooden Block' in texts(model, 1)


def test_a_machine_is_inspected_and_edited_until_nothing_is_left(play) -> None:
    model = Scripted(SMALL, FAULT, LARGE, DONE)
    played = play(client=model, workflow="tree-iterative")
    assert parts(played) == 3
    editors = texts(model, 2)
    assert "Too small." in editors
    assert '"face_id": 0}]' in editors
    assert "2 Small Wooden Block" in editors
    assert "The machine has not been tried." in editors


def test_edits_come_to_an_end(play) -> None:
    replies = [SMALL, *[FAULT, LARGE] * EDITS]
    model = Scripted(*replies, last=FAULT)
    assert parts(play(client=model, workflow="tree-iterative")) == 3
    assert len(model.requests) == len(replies)


def test_an_edit_that_cannot_be_built_leaves_the_machine_as_it_was(play) -> None:
    played = play(
        client=Scripted(LARGE, FAULT, *[BROKEN] * TREE_TURNS, DONE), workflow="tree-iterative"
    )
    assert parts(played) == 3


def test_an_edit_that_breaks_the_tasks_rules_is_not_used(play) -> None:
    most = builtin_tasks()["drive-1"].constraints.max_blocks
    row = [block(number, number - 1, 0) for number in range(1, most + 1)]
    model = Scripted(LARGE, FAULT, tree(*row), DONE)
    played = play(client=model, task="drive-1", workflow="tree-iterative")
    assert played.session.machine.part_count == 3


def test_a_further_round_of_a_closed_loop_edits_the_last_tree(play, rollout) -> None:
    model = Scripted(SMALL, DONE, FAULT, LARGE, DONE)
    played = play(
        client=model,
        workflow="tree-iterative",
        loop=Loop(rounds=2),
        rollouts=[rollout(0, success=False, indicator=7.5)],
    )
    assert parts(played) == 3
    assert played.suspended.number == 1
    assert "Load: 7.50 mass units." in texts(model, 2)
    assert [turn.role for turn in played.session.transcript.turns] == [
        *("designer", "inspector", "inspector", "editor", "inspector")
    ]


def test_a_task_with_test_trials_gives_the_editor_their_results(play, rollout) -> None:
    """One remains for the controller of the finished machine, and the last trial counts."""
    task = builtin_tasks()["identify-1"]
    config = [{"block": "2", "action": "fly", "keys": ["UpArrow"]}]
    press = [{"time": 1, "key": "UpArrow", "hold_for": 1}]
    keys = {"control_design": "", "control_config": config, "control_sequence": press}
    control = Completion(text=json.dumps(keys))
    flyer = tree(block(1, 0, 4, "Flying Block"))
    model = Scripted(flyer, *[control, FAULT, flyer] * EDITS, last=control)
    made = [rollout(number, success=False, indicator=0.5) for number in range(task.tests)]
    played = play(client=model, task="identify-1", workflow="tree-iterative", rollouts=made)
    assert played.suspended is not None, played.failure
    assert (played.suspended.number, played.suspended.final) == (task.tests, True)
    assert "In a test trial its controller drove it. It did not succeed." in texts(model, 2)
    first = [turn.role for turn in played.session.transcript.turns][:5]
    assert first == ["designer", "controller", "inspector", "editor", "controller"]


def test_parts_of_a_plan_are_added_to_one_tree_in_turn(play) -> None:
    model = TreeEngineer()
    played = play(client=model, task="transport-1", workflow="tree-hierarchical")
    assert [turn.role for turn in played.session.transcript.turns] == [
        *("planner", "designer", "designer", "joiner", "controller")
    ]
    spine, wheels, joining = (request.messages[1].text for request in model.requests[1:4])
    assert "## Part to add: spine" in spine
    assert "## Construction tree\n\n[]" in spine
    assert '"id": 4, "type": 15' in wheels
    assert "9 Powered Wheel" in joining


def test_modules_that_are_looked_up_have_their_points_told(play) -> None:
    model = Scripted(SMALL)
    played = play(client=model, task="flight-2", workflow="tree-single")
    assert played.suspended is not None, played.failure
    assert "Log (63): 0 front [0, 0, 3]" in texts(model, 0)


def test_the_example_of_the_prompt_can_be_built() -> None:
    machine = Machine(catalogue=module_set("basic"))
    example = tree_in(PromptPacks().load("default").roles["tree_designer"])
    assert all(action.outcome.ok for action in tree_actions(read_tree(example), machine))
    assert machine.part_count == 4


def test_the_prompt_says_where_the_sides_of_blocks_are(play) -> None:
    model = Scripted(SMALL)
    play(client=model, workflow="tree-single")
    for pointing, sides in POINTING.items():
        assert f"- {pointing}: {', '.join(sides)}\n" in texts(model, 0)
