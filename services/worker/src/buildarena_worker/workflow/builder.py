"""The workflow of one role: the builder designs and builds alone. Source: the paper's ablation."""

from __future__ import annotations

from buildarena_geometry import Machine
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.phases import solo_phase


class Builder:
    """One role, all tools."""

    name = "builder"

    def build(self, session: Session) -> Machine:
        """Builds the machine of the session's task as one structure."""
        return solo_phase(session)
