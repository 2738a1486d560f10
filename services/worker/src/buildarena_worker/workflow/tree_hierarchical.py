"""The workflow of hierarchical design: a planner's parts are added to one construction tree."""

from __future__ import annotations

from typing import Final

from buildarena_geometry import Machine
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.phases import plan_by
from buildarena_worker.workflow.trees import TreeWriter, edit_tree, summary_of, write_tree

MAX_PARTS: Final = 8
"""Parts of a plan; the planner's words name the same number."""
EMPTY: Final = "[]"


class TreeHierarchical:
    """A planner, a designer for each part in turn, and one who joins them.

    Source: BesiegeField's hierarchical design.
    """

    name = "tree-hierarchical"

    def build(self, session: Session) -> Machine:
        """Builds the machine of the session's task as one structure."""
        plan = plan_by(session, "tree_planner", parts=(1, MAX_PARTS))
        writer = TreeWriter(session, session.new_machine())
        for part in plan.sub_structures:
            values = {
                "plan": plan.text,
                "tree": writer.tree or EMPTY,
                "name": part.name,
                "part": part.text,
            }
            write_tree(
                session,
                writer,
                phase="build",
                role="designer",
                message="tree_part",
                values=values,
            )
        values = {
            "plan": plan.text,
            "tree": writer.tree,
            "summary": summary_of(writer.machine),
        }
        joined = edit_tree(session, writer, role="joiner", message="tree_join", values=values)
        return joined.machine
