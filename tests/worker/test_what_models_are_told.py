"""Every request of every workflow: it alternates, and nothing is absent, missing or told twice."""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import pytest
from support.providers.scripted import Recording

from buildarena_benchmark import builtin_tasks
from buildarena_geometry import load_catalogue, tool_definitions
from buildarena_worker.session.messages import Request
from buildarena_worker.workflow.machine_tools import parts_of
from buildarena_worker.workflow.rounds import Loop

TASKS = ("support-1", "support-3", "transport-1", "transport-2", "lift-2", "lift-3")
WORKFLOWS = ("five-role", "guidance-builder", "builder")
TOOLS = {tool.name for tool in tool_definitions()} | {"raise_objection"}
MODULES = [m for m in load_catalogue().values() if m.kind not in {"start", "cargo"}]
FRAME = "x points east, y north, z up"
START = "mass 0.25"

FACTS: dict[tuple[str, str], tuple[str, ...]] = {
    ("plan", "planner"): (FRAME, START, "middle of a free face", "<motion_control>"),
    ("draft", "drafter"): (FRAME, START, "You may move blocks to make the plan fit", "side"),
    ("draft", "reviewer"): (FRAME, START, "half the sum of their sizes", "block by block"),
    ("build", "guidance"): (
        FRAME,
        START,
        "twist_block",
        "clockwise seen from outside",
        "shift_block",
        "0.5",
        "flip_spin",
        "remove_block",
        "reset",
        "get_machine_summary",
        "get_block_details",
    ),
    ("build", "builder"): (FRAME, "state in a few lines what each of your tools does"),
    ("build", "engineer"): (FRAME, START, "`start`"),
    ("refine", "guidance"): (FRAME, "twist_block", "shift_block", "flip_spin"),
    ("assemble", "guidance"): (FRAME, "Brace", "Winch", "add_machine", "several times"),
    ("assemble", "builder"): (FRAME, "Brace", "several times"),
    ("control", "controller"): (
        "UpArrow",
        "spinning_forward",
        "## Plan",
        "no key",
        "100 rpm",
        "torque and brake up to 20",
        "Gravity is",
    ),
}
"""What a role must be able to read, by phase and role."""


@pytest.fixture(scope="module")
def played_requests() -> Callable[..., list[tuple[str, str, Request]]]:
    known: dict[tuple[str, str], list[tuple[str, str, Request]]] = {}

    def of(play, task: str, workflow: str) -> list[tuple[str, str, Request]]:
        if (task, workflow) not in known:
            model = Recording()
            played = play(task=task, workflow=workflow, client=model, loop=Loop(one_shot=True))
            turns = played.session.transcript.turns
            known[task, workflow] = [
                (turn.stage, _role(request), request)
                for turn, request in zip(turns, model.requests, strict=True)
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
            assert (before, after) not in {
                ("assistant", "assistant"),
                ("user", "user"),
                ("user", "tool"),
            }, where


def test_what_is_kept_as_told_is_what_the_session_says_and_each_text_once(
    play, played_requests
) -> None:
    for _, where, request in all_requests(play, played_requests):
        begins = all(message.role != "assistant" for message in request.messages)
        told = [message.text for message in request.told]
        if where[1] != "builder":  # who forgets is asked as if anew each time
            assert begins == any(message.role == "system" for message in request.told), where
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


def test_each_role_is_told_what_its_work_needs(play, played_requests) -> None:
    seen = set()
    for task, where, request in all_requests(play, played_requests):
        text = "\n".join(_told(request))
        seen.add(where)
        for fact in FACTS.get(where, ()):
            assert fact in text, (task, where, fact)
    # The controller comes after a simulation; it has a test of its own.
    assert set(FACTS) - seen <= {("control", "controller"), ("refine", "guidance")}


def test_who_plans_or_works_without_a_plan_knows_every_module(play, played_requests) -> None:
    for task, workflow in itertools.product(TASKS, WORKFLOWS):
        for stage, role, request in played_requests(play, task, workflow):
            without_plan = workflow == "guidance-builder" and (stage, role) == ("build", "guidance")
            if role in {"planner", "engineer"} or without_plan:
                text = "\n".join(_told(request))
                for module in MODULES:
                    assert re.search(rf"{module.name}.*mass {module.mass:g}", text), (task, role)


@pytest.mark.parametrize("task", ["mechanisms-1", "mechanisms-3", "flight-1", "support-1"])
def test_who_works_from_a_plan_knows_the_modules_that_it_names(play, task) -> None:
    model = Recording()
    played = play(task=task, client=model)
    catalogue = builtin_tasks()[task].constraints.catalogue
    (plan,) = (turn.text for turn in played.session.transcript.turns if turn.role == "planner")
    for turn, request in zip(played.session.transcript.turns, model.requests, strict=True):
        text = "\n".join(_told(request))
        described = {name for name, module in catalogue.items() if module.description in text}
        if turn.role in {"drafter", "reviewer"}:
            named = {name for name in catalogue if name in plan.replace("Sqr Balloon", "")}
            assert named <= described
            # The list as a whole is told once in a session.
            assert len(described) < len(catalogue) or len(catalogue) <= len(named) + 1
            for name, module in catalogue.items():
                assert module.kind != "connector" or name in text
        elif turn.role in {"builder", "guidance"}:
            assert not described


def test_a_plans_modules_are_found_by_their_names(subtests) -> None:
    for plan, named in [
        ("four POWERED WHEELS on small wooden blocks", {"Powered Wheel", "Small Wooden Block"}),
        ("a Steering Hinge", {"Steering Hinge"}),
        ("a Steering Hinge and a hinge", {"Steering Hinge", "Hinge"}),
        ("cog medium powered, log", {"Cog Medium Powered", "Log"}),
    ]:
        with subtests.test(plan=plan):
            given = builtin_tasks()["mechanisms-2"]
            text = parts_of(given, plan)
            connectors = set(given.constraints.catalogue.connectors)
            listed = set(re.findall(r"^- ([^:]+):", text, re.MULTILINE))
            assert listed == named | connectors | {"Starting Block"}
            assert len(parts_of(given, "something that rolls").splitlines()) == len(
                given.constraints.catalogue
            )


def test_no_sentence_is_told_twice(play, played_requests) -> None:
    for task, where, request in all_requests(play, played_requests):
        sentences = Counter(
            sentence for paragraph in _told(request) for sentence in _sentences(paragraph)
        )
        twice = [sentence for sentence, count in sentences.items() if count > 1]
        assert not twice, (task, where, twice)


def _sentences(paragraph: str) -> Sequence[str]:
    """Sentences of six words or more; lines of summaries and lists of actions aside."""
    if re.match(r"^\d+ parts|^\d+[. ]", paragraph):
        return ()
    found = re.split(r"(?<=[.;:])\s+|\n", paragraph)
    return [
        " ".join(s.split())
        for s in found
        if len(s.split()) > 5 and not s.startswith(("- ", "faces "))
    ]


def test_the_controller_keeps_its_past(play, rollout) -> None:
    model = Recording()
    records = [rollout(0, success=False, indicator=3.25), rollout(1, success=False, indicator=4.5)]
    for record in records:
        object.__setattr__(record, "trace", [[t, min(t, 4.0), 0.0, 1.0] for t in range(31)])
    played = play(task="transport-1", client=model, rollouts=records)
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
    for fact in FACTS["control", "controller"]:
        assert fact in first[0].text + opening


@pytest.mark.parametrize("keep", ["KEEP", "`KEEP`.", "**KEEP**\n"])
@pytest.mark.parametrize("succeeds_at", [0, 1])
def test_a_trial_that_succeeded_may_be_kept(play, rollout, keep, succeeds_at) -> None:
    model = Recording()
    model.complete = _keeping(model.complete, keep)
    records = [
        rollout(number, success=number == succeeds_at, indicator=5.0 + number)
        for number in range(succeeds_at + 1)
    ]
    played = play(task="transport-1", client=model, rollouts=records)
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
        assert "Criterion: " in text
        assert "min distance 10" in text


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
