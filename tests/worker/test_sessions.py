"""Sessions: plans, rounds, limits, and what a journal resumes."""

import itertools
import random

import pytest
from support.providers.scripted import Recording, Scripted, call

from buildarena_backend.errors import PermanentError, StaleLeaseError
from buildarena_backend.journal.journal import Usage
from buildarena_worker.session.messages import Completion, ToolCall
from buildarena_worker.session.requester import Spending
from buildarena_worker.session.results import Failed, SessionEnded
from buildarena_worker.workflow.phases import MAX_STEPS, steps_in
from buildarena_worker.workflow.plan import PlanError, parse_plan

START = call("start", init_shift=[0, 0, 0], init_rotation=[0, 0, 0], note="")
BLOCK = call("attach_block_to", base_block="1", face="A", new_block="Small Wooden Block", note="")
PLAN = Completion(
    text="""Here you are. <building_plan><overall_structure>a & b < c</overall_structure>
<sub_structures><sub_structure><name>one</name><description>a block</description></sub_structure>
</sub_structures></building_plan>"""
)
DRAWN = (PLAN, *(Completion(text=said) for said in ("drawing", "TERMINATE", "final")))
"""Replies up to the agreed drawing."""


def test_the_expert_builds_the_same_bridge_in_every_run(play) -> None:
    first, second = play(seed=1), play(seed=1)
    assert first.suspended is not None
    assert first.suspended.machine.to_document() == second.suspended.machine.to_document()
    assert first.entries == second.entries
    assert first.session.transcript.refusals == {}


def test_seeds_vary_the_expert_s_design(play) -> None:
    documents = [play(seed=seed).suspended.machine.to_document() for seed in (0, 1)]
    assert documents[0] != documents[1]


def test_every_workflow_leads_the_expert_to_a_machine(play, subtests) -> None:
    for workflow in ["five-role", "guidance-builder", "builder"]:
        with subtests.test(workflow=workflow):
            played = play(workflow=workflow)
            assert played.suspended is not None, played.failure
            assert played.suspended.machine.part_count > 12


def test_a_session_resumes_from_any_point_of_its_journal(play) -> None:
    whole = play(workflow="guidance-builder")
    wanted = whole.suspended.machine.to_document()
    for kept in range(0, len(whole.entries), 17):
        resumed = play(workflow="guidance-builder", entries=whole.entries[:kept])
        assert resumed.suspended.machine.to_document() == wanted
        assert resumed.entries == whole.entries
        assert resumed.session.transcript == whole.session.transcript


def test_a_journal_of_another_session_is_refused(play) -> None:
    other = play("builtin/random").entries
    failure = play(entries=other).failure
    assert isinstance(failure, PermanentError)


def test_the_reply_is_journalled_before_it_is_used(play) -> None:
    def fail(_: object) -> None:
        raise ConnectionError("the database is gone")

    played = play(append=fail)
    assert isinstance(played.failure, ConnectionError)
    assert played.session.transcript.turns == []


def test_a_lost_lease_stops_the_session_before_it_pays(play) -> None:
    model = Scripted()
    failure = play(client=model, lost=True).failure
    assert isinstance(failure, StaleLeaseError)
    assert model.requests == []


def test_limits_stop_a_session_within_one_request(play, subtests) -> None:
    for limits, requests in [
        ({"max_requests": 3}, 3),
        ({"max_tokens": 40}, 3),
        ({"max_duration_s": 4}, 4),
    ]:
        with subtests.test(limits=limits):
            played = play(workflow="builder", client=Scripted(last=START), limits=limits)
            assert isinstance(played.failure, Failed)
            assert played.failure.reason in limits
            assert len(played.entries) == requests


def test_an_unreadable_plan_gets_one_more_try(play) -> None:
    model = Scripted(Completion(text="I would rather not."), PLAN)
    played = play(client=model)
    assert "there is no <building_plan>" in model.requests[1].messages[-1].text
    assert [turn.stage for turn in played.session.transcript.turns][:3] == ["plan", "plan", "draft"]


def test_too_many_sub_structures_fail_the_plan(play) -> None:
    part = "<sub_structure><name>{}</name><function>x</function></sub_structure>"
    text = PLAN.text.replace("</sub_structures>", part.format("two") + "</sub_structures>")
    failure = play(client=Scripted(last=Completion(text=text))).failure
    assert isinstance(failure, Failed)
    assert failure.reason == "constraint_violated"
    assert "2 sub-structures, the task allows 1" in failure.detail
    # One such plan, as one that can't be read, costs a turn.
    model = Scripted(Completion(text=text), Completion(text="no"), Completion(text="no"), PLAN)
    played = play(client=model)
    assert [turn.stage for turn in played.session.transcript.turns][:5] == ["plan"] * 4 + ["draft"]
    assert "2 sub-structures, the task allows 1" in model.requests[1].messages[-1].text


def test_an_objection_ends_the_session(play, subtests) -> None:
    for role in ["reviewer", "guidance"]:
        with subtests.test(role=role):
            objection = call("raise_objection", reason="no rope")
            draft = Completion(text="a drawing")
            replies = [PLAN, draft, objection]
            if role == "guidance":
                replies = [PLAN, draft, Completion(text="TERMINATE"), draft, START, objection]
            failure = play(client=Scripted(*replies)).failure
            assert isinstance(failure, Failed)
            assert failure.reason == "objection"
            assert failure.detail == f"{role}: no rope"


def test_a_malformed_objection_is_refused_and_ends_nothing(play, subtests) -> None:
    draft = Completion(text="a drawing")
    for arguments in ("no json", [1], {}, {"reason": ""}, {"reason": 3}, {"reason": "x", "y": 1}):
        with subtests.test(arguments=arguments):
            objection = ToolCall(id="c", name="raise_objection", arguments=arguments)
            replies = [PLAN, draft, Completion(text="", calls=(objection,)), draft]
            played = play(client=Scripted(*replies, last=call("raise_objection", reason="no")))
            assert played.session.transcript.refusals == {"malformed_arguments": 1}
            assert played.failure.detail == "reviewer: no"


def test_parallel_calls_are_refused_and_do_nothing(play) -> None:
    twice = Completion(text="", calls=(*START.calls, ToolCall(id="c2", name="reset", arguments={})))
    model = Scripted(twice)
    played = play(workflow="builder", client=model)
    (first, *_) = played.session.transcript.turns
    assert [action.reason for action in first.actions] == ["parallel_calls"] * 2
    assert not played.session.machine.started
    answers = [m for m in model.requests[1].messages if m.role == "tool"]
    assert [m.call_id for m in answers] == ["c1", "c2"]


def _called(arguments: object) -> Completion:
    return Completion(text="", calls=(ToolCall(id="c", name="start", arguments=arguments),))


def test_bad_tool_calls_are_refused_with_one_class(play, subtests) -> None:
    for reply, reason in [
        (call("fly", height=3), "unknown_action"),
        *((_called(arguments), "malformed_arguments") for arguments in ("no json", [1])),
        (BLOCK, "initialization_absent"),
    ]:
        with subtests.test(reply=reply):
            played = play(workflow="builder", client=Scripted(reply))
            assert played.session.transcript.refusals == {reason: 1}


def test_an_empty_reply_is_heard_as_no_answer(play) -> None:
    model = Scripted(*DRAWN, Completion(text=""))
    play(client=model)
    assert model.requests[5].messages[-1].text.endswith("[builder] (no answer)")


def test_roles_see_the_thread_from_their_own_side(play) -> None:
    model = Scripted(*DRAWN, START, Completion(text="Go on."), START)
    play(client=model)
    builder, guidance = model.requests[6].messages, model.requests[5].messages
    # The builder reads what it is told now, and nothing of what it did before.
    assert [m.role for m in builder] == ["system", "user"]
    assert builder[-1].text.endswith("\n\n[guidance] Go on.")
    assert "Started" not in builder[-1].text
    assert [m.role for m in guidance] == ["system", "user"]
    assert "[builder] Started. 1 Starting Block" in guidance[-1].text
    # Guidance works from the drawing; the builder does what guidance says.
    assert "final" in guidance[-1].text
    assert all("final" not in m.text for m in builder)


STEPS = "1. Start.\n2. A block on its east.\n3. One more."


def spoken(play, guidance: str, *builder: Completion) -> list[str]:
    """The roles that speak after guidance has said this for the first time."""
    model = Scripted(*DRAWN, Completion(text="My tools."), Completion(text=guidance), *builder)
    turns = play(client=model).session.transcript.turns
    return [turn.role for turn in turns if turn.stage == "build"][2:]


def test_numbered_steps_are_carried_out_one_after_the_other(play, subtests) -> None:
    for guidance, builder, turns in [
        (STEPS, [START, BLOCK], 3),
        ("First\n  1) start,\n  2) a block.", [START, BLOCK], 2),
        ("Start, then 2. a block.", [START, BLOCK], 1),
        ("Start.", [START, BLOCK], 1),
        # What is refused, and what is no call, is read by guidance at once.
        (STEPS, [START, START, BLOCK], 2),
        (STEPS, [Completion(text="How?"), START], 1),
    ]:
        with subtests.test(guidance=guidance):
            further = call(
                "attach_block_to", base_block="2", face="E", new_block="Small Wooden Block"
            )
            roles = spoken(play, guidance, *builder, further)
            assert roles[: turns + 1] == ["builder"] * turns + ["guidance"]


def test_steps_are_counted_up_to_a_bound(subtests) -> None:
    for count in [0, 1, 2, MAX_STEPS, MAX_STEPS + 5]:
        with subtests.test(count=count):
            text = "\n".join(f"{n}. attach" for n in range(7, 7 + count))
            assert steps_in(f"Now:\n{text}") == max(1, min(count, MAX_STEPS))


def test_a_builders_view_grows_through_its_steps_and_begins_anew(play) -> None:
    model = Recording()
    played = play(client=model)
    views = [
        request.messages
        for turn, request in zip(played.session.transcript.turns, model.requests, strict=True)
        if (turn.stage, turn.role) == ("build", "builder")
    ]
    pairs = enumerate(itertools.pairwise(views))
    anew = [place for place, (a, b) in pairs if list(b[: len(a)]) != list(a)]
    assert anew
    for before, after in itertools.pairwise(views):
        # What is always there is a prefix that providers cache.
        assert before[0] == after[0]
        openings = {view[1].text.partition("[guidance]")[0].strip() for view in (before, after)}
        assert len(openings) == 1
    assert max(len(view) for view in views) <= 2 + 2 * MAX_STEPS


def test_a_stage_ends_with_the_word_alone_on_the_last_line(play, subtests) -> None:
    for text, ends in [
        ("TERMINATE", True),
        ("All is as drawn.\n\n**TERMINATE**.\n", True),
        ("When it is done I shall say TERMINATE.", False),
        ("TERMINATE\nOr rather, one more block.", False),
        ("Not yet: do not TERMINATE", False),
    ]:
        with subtests.test(text=text):
            model = Scripted(START, BLOCK, Completion(text=text), last=Completion(text="TERMINATE"))
            played = play(workflow="builder", client=model)
            assert (len(played.entries) == 3) == ends


def test_a_machine_of_one_block_is_no_machine(play) -> None:
    failure = play(workflow="builder", client=Scripted(START)).failure
    assert isinstance(failure, Failed)
    assert failure.reason == "empty_machine"


def test_endless_talk_meets_the_turn_limit(play) -> None:
    talk = Completion(text="Let me think.")
    played = play(workflow="builder", client=Scripted(last=talk))
    assert isinstance(played.failure, Failed)
    assert played.failure.reason == "turn_limit"
    assert len(played.entries) == 300


def test_a_reply_that_came_after_the_lease_had_ended_is_paid_for_and_not_used(play) -> None:
    def refuse(_: object) -> None:
        raise StaleLeaseError("job", 1)

    budgets = Budgets()
    played = play(client=Scripted(), append=refuse, budgets=budgets)
    assert isinstance(played.failure, StaleLeaseError)
    assert [usage.requests for usage in budgets.lost] == [1]
    assert played.session.transcript.turns == []


class Budgets:
    """Notes what was paid for in vain."""

    def __init__(self) -> None:
        self.lost: list[Usage] = []

    def charge_lost(self, _: object, usage: Usage) -> None:
        self.lost.append(usage)


GOOD = """<building_plan><overall_structure>all</overall_structure><sub_structures>
<sub_structure><name>deck</name><description>flat & long</description></sub_structure>
<sub_structure><name>tower</name><function>holds < ropes</function></sub_structure>
</sub_structures></building_plan>"""


def test_a_plan_is_found_among_other_words() -> None:
    plan = parse_plan(f"Thinking…\n{GOOD}\nDone.")
    assert [part.name for part in plan.sub_structures] == ["deck", "tower"]
    assert plan.sub_structures[0].text == "- description: flat & long"
    assert plan.text == "all"


def test_the_last_plan_counts() -> None:
    assert parse_plan(GOOD.replace("deck", "draft") + GOOD).sub_structures[0].name == "deck"


def test_what_is_missing_is_said(subtests) -> None:
    for text, says in [
        ("", "no <building_plan>"),
        ("<building_plan></building_plan>", "no <sub_structure>"),
        (GOOD.replace("overall_structure", "overall"), "no <overall_structure>"),
        (GOOD.replace("<name>deck</name>", ""), "sub-structure 1 has no <name>"),
        (GOOD.replace("tower", "deck"), "'deck' stands for several"),
        (GOOD.replace("<function>holds < ropes</function>", ""), "'tower' says nothing"),
    ]:
        with subtests.test(text=text), pytest.raises(PlanError, match=says):
            parse_plan(text)


def test_a_request_that_did_not_come_in_time_reaches_the_limit_whatever_was_used_before() -> None:
    rng = random.Random(4)
    for _ in range(2000):
        limit = rng.choice([0.1, 1.5, 60, 1e9]) * rng.uniform(0.5, 2)
        spending = Spending({"max_duration_s": limit}, seconds=limit * rng.random())
        left = spending.remaining_s
        latency_s = spending.to_the_end(left * rng.choice([1e-9, 0.5, 1.0, 1.01]))
        spending.seconds += latency_s
        assert latency_s <= left * 1.01 + 1e-6 * limit
        with pytest.raises(SessionEnded, match="max_duration_s"):
            spending.require_room()
