"""The workflow without planning: guidance and builder alone. Source: the paper's ablation."""

from __future__ import annotations

from buildarena_geometry import Machine
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.base import require_started
from buildarena_worker.workflow.machine_tools import modules_of
from buildarena_worker.workflow.phases import build_phase, refine_phase
from buildarena_worker.workflow.plan import SubStructure


class GuidanceBuilder:
    """Guidance designs as it goes; the builder acts."""

    name = "guidance-builder"

    def build(self, session: Session) -> Machine:
        """Builds the machine of the session's task as one structure."""
        brief = session.pack.say("no_drawing", statement=session.statement)
        part = SubStructure(name="machine", text=brief)
        modules = modules_of(session)
        machine = build_phase(session, part, brief, modules=modules)
        require_started(machine)
        return refine_phase(session, machine, part, brief)
