"""What the tree workflows share: roles that write a machine as a construction tree.

What a role writes is carried out by the session's own tools, so that transcript, replay and
verification are those of any machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from buildarena_geometry import Machine, Refused, modules_named
from buildarena_geometry.errors import TreeError
from buildarena_geometry.trees import points_text, read_tree, tree_actions, tree_in
from buildarena_pipeline.transcript import ActionResult
from buildarena_worker.session.dialogue import Dialogue, Role
from buildarena_worker.session.results import ConstructionFailedError
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.machine_tools import modules_of
from buildarena_worker.workflow.phases import SHOWN, looking_up, speak

TREE_TURNS: Final = 5
"""Answers a designer may need until its tree can be built; one costs a turn, not the session."""
NO_TREE: Final = "tree_invalid"
"""Why a construction failed whose tree could not be built."""


class TreeWriter:
    """Builds each tree that a role writes.

    Args:
        session: The session.
        machine: What is built; a further tree takes the place of what was there.

    Attributes:
        machine: As given.
        tree: The last tree that was built, "" before the first.
        error: Why the last reply could not be built; None if it was.
    """

    def __init__(self, session: Session, machine: Machine) -> None:
        self.machine = machine
        self.tree = ""
        self.error: TreeError | None = None
        self._act = session.acting(machine)

    def carry_out(self, text: str) -> list[ActionResult]:
        """Builds the tree of a reply, up to the first action that is refused."""
        self.error = None
        results: list[ActionResult] = []
        try:
            tree = tree_in(text)
            for action in tree_actions(read_tree(tree), self.machine, self._act):
                outcome = action.outcome
                results.append(
                    ActionResult(
                        name=action.name,
                        arguments=action.arguments,
                        ok=outcome.ok,
                        reason=outcome.reason.value if isinstance(outcome, Refused) else None,
                        feedback=outcome.text,
                    )
                )
        except TreeError as error:
            self.error = error
        else:
            self.tree = tree
        return results


def write_tree(
    session: Session,
    writer: TreeWriter,
    *,
    phase: str,
    role: str,
    message: str,
    values: Mapping[str, str] | None = None,
) -> None:
    """Lets a role write a tree, again while it can't be built.

    Args:
        session: The session.
        writer: Builds it.
        phase: The phase.
        role: The role's name.
        message: The pack's message that it reads first.
        values: What stands in that message besides task, statement, modules and building points.

    Raises:
        ConstructionFailedError: No tree within the turns could be built.
    """
    pack = session.pack
    opening = pack.say(
        message,
        task=session.task.name,
        statement=session.statement,
        modules=modules_of(session),
        points=offered_points(session),
        **(values or {}),
    )
    dialogue = Dialogue(session, phase=phase, opening=opening)
    system = pack.roles["tree_designer"]
    speaker = looking_up(session, Role(name=role, system=system, carry_out=writer.carry_out))
    for _ in range(TREE_TURNS):
        text = speak(dialogue, speaker).text
        if writer.error is None:
            return
        dialogue.remark(speaker, pack.say("tree_again", error=str(writer.error)))
    raise ConstructionFailedError(NO_TREE, f"{writer.error}; the {role} said {text[:SHOWN]!r}")


def offered_points(session: Session) -> str:
    """The building points of a task's modules."""
    catalogue = session.catalogue
    names = modules_named(session.task.constraints.modules)
    return points_text([catalogue.start, *(catalogue[name] for name in names)])


def summary_of(machine: Machine) -> str:
    """A machine's parts in words."""
    return machine.act("get_machine_summary", {}).text


def edit_tree(
    session: Session, writer: TreeWriter, *, role: str, message: str, values: Mapping[str, str]
) -> TreeWriter:
    """Lets a role write a built tree again, on a copy: what is finished is not lost.

    Returns:
        The writer of the machine that is to be used: the former where the new tree could not be
        built, or breaks rules of the task that the former does not.
    """
    edited = TreeWriter(session, writer.machine.copy())
    try:
        write_tree(session, edited, phase="refine", role=role, message=message, values=values)
    except ConstructionFailedError as failure:
        if failure.reason != NO_TREE:
            raise
        return writer
    if session.breaks_rules(edited.machine) and not session.breaks_rules(writer.machine):
        return writer
    session.machine = edited.machine
    return edited
