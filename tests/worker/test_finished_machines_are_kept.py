"""Refinement cannot ruin a finished machine; plans are read in both forms."""

from __future__ import annotations

import pytest
from support.providers.scripted import call

from buildarena_worker.builtin import BuiltinClient
from buildarena_worker.session.messages import Completion, Request
from buildarena_worker.workflow.plan import read_plan


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


@pytest.mark.parametrize(
    ("guidance", "spoils"),
    [
        (call("raise_objection", reason="it is all wrong"), False),
        (Completion(text="TERMINATE"), True),
        (Completion(text="Go on and on."), False),
    ],
)
def test_a_refinement_that_fails_leaves_the_machine_as_it_was(play, guidance, spoils) -> None:
    plain = play(task="transport-1").session
    away = call("shift_block", block_id="2", shift_real=[0.0, 0.0, 0.5])
    model = Spoiling(guidance=guidance, builder=away)
    played = play(task="transport-1", client=model)
    assert played.suspended is not None, played.failure
    kept = played.session.machine.to_document()["blocks"]
    if spoils:
        # Three shifts part the block, which the task's rules forbid: the correction is not taken.
        assert played.session.transcript.actions > plain.transcript.actions
    assert kept == plain.machine.to_document()["blocks"]


def test_a_refinement_within_the_rules_is_taken(play) -> None:
    plain = play(task="transport-1").session.machine
    wheel = next(block.id for block in plain.blocks.values() if block.module.spins)
    model = Spoiling(
        guidance=Completion(text="TERMINATE"), builder=call("flip_spin", block_id=wheel)
    )
    refined = play(task="transport-1", client=model).session.machine
    assert refined.blocks[wheel].flipped != plain.blocks[wheel].flipped


def test_plans_are_read_in_the_published_form() -> None:
    plan = read_plan(
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
    assert (plan.assembly, plan.motion_control) == ("none", "two wheels")
    assert plan.text == "A cart\nIt rolls\nAssembly: none\nMotion control: two wheels"


def test_plans_are_read_in_our_form() -> None:
    plan = read_plan(
        """<building_plan><overall_structure>A cart that rolls</overall_structure>
        <motion_control>one wheel</motion_control><sub_structures><sub_structure>
        <name>body</name><motion_control>the wheel turns</motion_control></sub_structure>
        </sub_structures></building_plan>"""
    )
    assert (plan.overall, plan.assembly, plan.motion_control) == (
        "A cart that rolls",
        "",
        "one wheel",
    )
