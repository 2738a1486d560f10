"""The workflow of iterative editing: a construction tree is inspected and written again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from buildarena_geometry import Machine
from buildarena_worker.session.dialogue import Dialogue, Role, terminates
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.control import try_out
from buildarena_worker.workflow.machine_tools import modules_of
from buildarena_worker.workflow.phases import looking_up, speak
from buildarena_worker.workflow.trees import TreeWriter, edit_tree, summary_of, write_tree

EDITS: Final = 3
"""Times a machine may be inspected and edited."""
DESIGNER: Final = "designer"
EDITOR: Final = "editor"


class TreeIterative:
    """A designer, then rounds of inspector and editor. Source: BesiegeField's iterative editing.

    Where the task has test trials, a machine is driven in one before it is inspected. In a further
    round of a closed loop the last round's tree is edited.
    """

    name = "tree-iterative"

    def build(self, session: Session) -> Machine:
        """Builds the machine of the session's task as one structure."""
        before = _last_tree(session)
        writer = TreeWriter(session, session.new_machine())
        writer.carry_out(before)
        if writer.error is not None:
            write_tree(session, writer, phase="build", role=DESIGNER, message="tree_design")
        for _ in range(EDITS):
            values = {
                "tree": writer.tree,
                "summary": summary_of(writer.machine),
                "trial": _trial(session, writer.machine),
            }
            inspection = _inspection(session, values)
            if not inspection:
                break
            values["inspection"] = inspection
            writer = edit_tree(session, writer, role=EDITOR, message="tree_edit", values=values)
        return writer.machine


def _last_tree(session: Session) -> str:
    """The reply with the last tree that was built; "" in the first round of a session."""
    replies = (
        turn.text
        for turn in reversed(session.transcript.turns)
        if turn.role in {DESIGNER, EDITOR}
        and turn.actions
        and all(action.ok for action in turn.actions)
    )
    return next(replies, "")


def _trial(session: Session, machine: Machine) -> str:
    """How a machine does in a test trial, in words; one such trial stays for its controller."""
    tests, pack = session.task.tests, session.pack
    result = try_out(session, machine) if session.tests_used + 1 < tests else ""
    if not result:
        return pack.say("tree_untried")
    return pack.say("tree_tried", result=result)


def _inspection(session: Session, values: Mapping[str, str]) -> str:
    """What the inspector finds; "" if nothing is to be mended."""
    pack = session.pack
    opening = pack.say(
        "tree_inspect",
        task=session.task.name,
        statement=session.statement,
        modules=modules_of(session),
        **values,
    )
    dialogue = Dialogue(session, phase="inspect", opening=opening)
    inspector = Role(name="inspector", system=pack.roles["tree_inspector"])
    reply = speak(dialogue, looking_up(session, inspector))
    return "" if terminates(reply) else reply.text
