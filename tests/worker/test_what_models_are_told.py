"""Every request of every workflow: it alternates, and nothing is absent, missing or told twice."""

import dataclasses
import itertools
import re
from collections.abc import Callable, Iterator

import pytest
from support.providers.scripted import Recording, call

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import load_catalogue, tool_definitions
from buildarena_worker.builtin import BuiltinClient
from buildarena_worker.session.messages import Completion, Request
from buildarena_worker.workflow.machine_tools import parts_of
from buildarena_worker.workflow.plan import parse_plan

TASKS = ("support-3", "transport-1", "lift-3")
WORKFLOWS = ("five-role", "guidance-builder", "builder")
TOOLS = {tool.name for tool in tool_definitions()} | {"raise_objection"}
MODULES = [m for m in load_catalogue().values() if m.kind not in {"start", "cargo"}]


@pytest.fixture(scope="module")
def played_requests() -> Callable[..., list[tuple[str, str, Request]]]:
    known: dict[tuple[str, str], list[tuple[str, str, Request]]] = {}

    def of(play, task: str, workflow: str) -> list[tuple[str, str, Request]]:
        if (task, workflow) not in known:
            model = Recording()
            played = play(task=task, workflow=workflow, client=model, loop={"one_shot": True})
            turns = played.session.transcript.turns
            asked = zip(turns, model.requests, strict=True)
            known[task, workflow] = [
                (turn.stage, _role(request), request) for turn, request in asked
            ]
        return known[task, workflow]

    return of


def _role(request: Request) -> str:
    return request.messages[0].text.splitlines()[0].removeprefix("# Role: ")


def _told(request: Request) -> Iterator[str]:
    """What the session itself says in a request: not what roles said, nor what tools answered."""
    for message in request.messages:
        if message.role in {"system", "user"}:
            for paragraph in message.text.split("\n\n"):
                # What a role said or drew stands in brackets or under its own heading.
                if not paragraph.startswith(("[", "Drawing of ")):
                    yield paragraph


def all_requests(play, played_requests) -> Iterator[tuple[str, tuple[str, str], Request]]:
    for task, workflow in itertools.product(TASKS, WORKFLOWS):
        for stage, role, request in played_requests(play, task, workflow):
            yield task, (stage, role), request


def test_replies_alternate_with_what_is_read(play, played_requests) -> None:
    for _, where, request in all_requests(play, played_requests):
        roles = [message.role for message in request.messages]
        assert roles[:2] == ["system", "user"], where
        assert roles.count("system") == 1
        assert roles[-1] in {"user", "tool"}
        for before, after in itertools.pairwise(roles):
            wrong = {("assistant", "assistant"), ("user", "user"), ("user", "tool")}
            assert (before, after) not in wrong, where


def test_what_is_kept_as_told_is_what_a_session_says_each_text_once(play, played_requests) -> None:
    for _, where, request in all_requests(play, played_requests):
        begins = all(message.role != "assistant" for message in request.messages)
        new = request.new_messages or {"user": []}
        told = [new[role] for role in ("system",) if role in new] + new["user"]
        if where[1] != "builder":  # who forgets is asked as if anew each time
            assert begins == ("system" in new), where
        for text in told:
            assert any(text in message.text for message in request.messages), where
        kept = "\n".join(told)
        assert not begins or not told or all(text in kept for text in _told(request)), where


def test_nobody_is_told_of_tools_that_are_not_there(play, played_requests) -> None:
    for _, where, request in all_requests(play, played_requests):
        text = "\n".join(_told(request))
        there = {tool.name for tool in request.tools}
        if where[1] == "guidance":  # the builder's tools, told as such
            listed = text.partition("## The builder's tools")[2]
            there |= set(re.findall(r"^- (\w+): ", listed, re.MULTILINE))
        named = {name for name in TOOLS if f"`{name}`" in text or ("_" in name and name in text)}
        example = "## Example" in text  # a construction as the actions that built it
        assert example or named <= there, (where, named - there)


def test_nobody_is_told_of_modules_that_the_task_does_not_allow(play) -> None:
    task = builtin_tasks()["support-1"]
    constraints = task.constraints.model_copy(update={"modules": ("Small Wooden Block", "Brace")})
    object.__setattr__(task, "constraints", constraints)
    try:
        for workflow in WORKFLOWS:
            model = Recording()
            play(task=task, workflow=workflow, client=model)
            for request in model.requests:
                text = "\n".join(_told(request)).lower()
                for name in ("powered wheel", "winch"):
                    assert name not in text, (workflow, _role(request))
    finally:
        object.__setattr__(task, "constraints", constraints.model_copy(update={"modules": None}))


def test_who_plans_or_works_without_a_plan_knows_every_module(play, played_requests) -> None:
    for task, workflow in itertools.product(TASKS, WORKFLOWS):
        for stage, role, request in played_requests(play, task, workflow):
            without_plan = workflow == "guidance-builder" and (stage, role) == ("build", "guidance")
            if role in {"planner", "engineer"} or without_plan:
                text = "\n".join(_told(request))
                for module in MODULES:
                    assert re.search(rf"{module.name}.*mass {module.mass:g}", text), (task, role)


def test_a_plans_modules_are_found_by_their_names(subtests) -> None:
    for plan, named in [
        ("four POWERED WHEELS on small wooden blocks", {"Powered Wheel", "Small Wooden Block"}),
        ("a Steering Hinge", {"Steering Hinge"}),
        ("a Steering Hinge and a hinge", {"Steering Hinge", "Hinge"}),
        ("cog medium powered, log", {"Cog Medium Powered", "Log"}),
    ]:
        with subtests.test(plan=plan):
            given = builtin_tasks()["mechanisms-1"]
            text = parts_of(given, plan)
            connectors = set(given.constraints.catalogue.connectors)
            listed = set(re.findall(r"^- ([^:]+):", text, re.MULTILINE))
            assert listed == named | connectors | {"Starting Block"}
            lines = parts_of(given, "something that rolls").splitlines()
            assert len(lines) == len(given.constraints.catalogue)


def test_the_controller_keeps_its_past(play, rollout) -> None:
    model = Recording()
    records = [rollout(0, success=False, indicator=3.25), rollout(1, success=False, indicator=4.5)]
    for record in records:
        object.__setattr__(record, "trace", [[t, min(t, 4.0), 0.0, 1.0] for t in range(31)])
    played = play(task="transport-1", client=model, rollouts=records, test_trials=False)
    asked = [r for r in model.requests if _role(r) == "controller"]
    assert played.suspended is not None
    assert len(asked) == 3
    first, _, last = (r.messages for r in asked)
    assert [m.role for m in last] == ["system", "user", *["assistant", "user"] * 2]
    text = "\n".join(m.text for m in last)
    assert "3.25" in text
    assert "4.50" in text
    # The idle tail of the trajectory is one line.
    assert "It stays there until 30 s." in text
    assert "20.00, 4.00" not in text
    # The plan, and every powered block once, with its actions and keys.
    opening = first[1].text
    machine = played.session.machine
    for block in machine.blocks.values():
        lines = [line for line in opening.splitlines() if line.startswith(f"{block.id} ")]
        assert len(lines) == 1, block.id
        if block.module.actions:
            assert all(action in lines[0] for action in block.module.actions)


def test_a_trial_that_succeeded_may_be_kept(play, rollout, subtests) -> None:
    for keep in ["KEEP", "`KEEP`.", "**KEEP**\n"]:
        for succeeds_at in [0, 1]:
            with subtests.test(keep=keep, succeeds_at=succeeds_at):
                model = Recording()
                model.complete = _keeping(model.complete, keep)
                made = [(n, n == succeeds_at, 5.0 + n) for n in range(succeeds_at + 1)]
                records = [
                    rollout(n, success=success, indicator=figure) for n, success, figure in made
                ]
                played = play(task="transport-1", client=model, rollouts=records, test_trials=False)
                assert played.end is not None, played.failure
                assert played.end.best.number == succeeds_at
                asked = [r for r in model.requests if _role(r) == "controller"]
                assert len(asked) == succeeds_at + 2
                last = asked[-1].messages[-1].text
                assert "KEEP" in last
                assert "It succeeded." in last
                for earlier in asked[1:-1]:
                    text = earlier.messages[-1].text
                    assert "KEEP" not in text
                    assert "; 10 is asked." in text or "did not drive" in text


def _keeping(complete, keep):
    """A controller that keeps what succeeded, in these words."""

    def answer(request, options=None):
        completion = complete(request, options)
        keeps = _role(request) == "controller" and "KEEP" in request.messages[-1].text
        return dataclasses.replace(completion, text=keep) if keeps else completion

    return answer


def test_before_a_success_nothing_is_kept(play) -> None:
    model = Recording()
    complete = model.complete
    model.complete = lambda request, options=None: (
        dataclasses.replace(complete(request, options), text="KEEP")
        if _role(request) == "controller"
        else complete(request, options)
    )
    played = play(task="transport-1", client=model)
    assert played.failure.reason == "control_invalid"


class Spoiling:
    """The expert, until the machine is to be refined: then it is spoilt at guidance's request."""

    def __init__(self, *, guidance: Completion, builder: Completion) -> None:
        self._expert = BuiltinClient("expert")
        self._guidance, self._builder = guidance, builder
        self._left = 3

    def complete(self, request: Request, options: object = None) -> Completion:
        del options
        text = "\n".join(message.text for message in request.messages)
        if "## Refinement of: " not in text:
            return self._expert.complete(request)
        builds = "# Role: builder" in text
        if not builds and self._left == 0:
            reply = self._guidance
        else:
            reply = self._builder if builds else Completion(text="Do it.")
            self._left -= not builds
        return reply


def test_a_refinement_that_fails_leaves_the_machine_as_it_was(play, subtests) -> None:
    for guidance, spoils in [
        (call("raise_objection", reason="it is all wrong"), False),
        (Completion(text="TERMINATE"), True),
        (Completion(text="Go on and on."), False),
    ]:
        with subtests.test(guidance=guidance):
            plain = play(task="transport-1").session
            away = call("shift_block", block_id="2", shift_real=[0.0, 0.0, 0.5])
            model = Spoiling(guidance=guidance, builder=away)
            played = play(task="transport-1", client=model)
            assert played.suspended is not None, played.failure
            kept = played.session.machine.to_document()["blocks"]
            if spoils:
                # Three shifts part the block, which the task's rules forbid.
                assert played.session.transcript.actions > plain.transcript.actions
            assert kept == plain.machine.to_document()["blocks"]


def test_a_refinement_within_the_rules_is_taken(play) -> None:
    plain = play(task="transport-1").session.machine
    wheel = next(block.id for block in plain.blocks.values() if block.module.spins)
    flip = call("flip_spin", block_id=wheel)
    model = Spoiling(guidance=Completion(text="TERMINATE"), builder=flip)
    refined = play(task="transport-1", client=model).session.machine
    assert refined.blocks[wheel].flipped != plain.blocks[wheel].flipped


def test_plans_are_read_in_the_published_form() -> None:
    plan = parse_plan(
        """<building_plan><overall_structure>
        <description>A cart</description><functionality>It rolls</functionality>
        <assembly>none</assembly><motion_control>two wheels</motion_control></overall_structure>
        <sub_structures>
        <sub_structure_1><name>body</name><description>a beam</description>
        <assembly>in a row</assembly></sub_structure_1>
        <sub_structure_2><name>tail</name><function>drags</function></sub_structure_2>
        </sub_structures></building_plan>"""
    )
    assert [part.name for part in plan.sub_structures] == ["body", "tail"]
    assert "in a row" in plan.sub_structures[0].text
    assert plan.text == "A cart\nIt rolls\nAssembly: none\nMotion control: two wheels"


def test_data_sheets_are_told_to_builders_unless_they_are_withheld(play) -> None:
    for told in (True, False):
        model = Recording()
        play(task="lift-1", client=model, data_sheets=told)
        assert any("A module's coordinates" in str(request) for request in model.requests) is told
