"""The workflow of one designer, who writes the machine as one construction tree in one reply."""

from __future__ import annotations

from buildarena_geometry import Machine
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.trees import TreeWriter, write_tree


class TreeSingle:
    """One role, one tree. Source: BesiegeField's single agent."""

    name = "tree-single"

    def build(self, session: Session) -> Machine:
        """Builds the machine of the session's task as one structure."""
        writer = TreeWriter(session, session.new_machine())
        write_tree(session, writer, phase="build", role="designer", message="tree_design")
        return writer.machine
