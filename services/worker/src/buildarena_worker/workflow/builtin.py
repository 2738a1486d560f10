"""The built-in workflows: five roles, guidance and builder, or the builder alone."""

from __future__ import annotations

from buildarena_geometry import Machine
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.machine_tools import modules_of
from buildarena_worker.workflow.phases import (
    assemble_phase,
    build_phase,
    draft_phase,
    plan_phase,
    refine_phase,
    require_started,
    solo_phase,
)
from buildarena_worker.workflow.plan import SubStructure


class FiveRole:
    """Plan, then draft, build and refine each sub-structure, then assemble.

    Source: the paper's section on the agentic workflow.
    """

    name = "five-role"

    def build(self, session: Session) -> Machine:
        """Build the machine of the session's task."""
        plan = plan_phase(session)
        machines: dict[str, Machine] = {}
        for part in plan.sub_structures:
            blueprint = draft_phase(session, plan, part)
            machine = build_phase(session, part, blueprint)
            require_started(machine)
            machines[part.name] = refine_phase(session, machine, part, blueprint)
        if len(machines) == 1:
            return next(iter(machines.values()))
        return assemble_phase(session, plan, machines)


class GuidanceBuilder:
    """Guidance designs step by step and the builder acts, without a plan.

    Source: the paper's ablation.
    """

    name = "guidance-builder"

    def build(self, session: Session) -> Machine:
        """Build the machine of the session's task as one structure."""
        brief = session.say("no_drawing", statement=session.statement)
        part = SubStructure(name="machine", text=brief)
        modules = modules_of(session)
        machine = build_phase(session, part, brief, modules=modules)
        require_started(machine)
        return refine_phase(session, machine, part, brief)


class Builder:
    """One role with all tools designs and builds. Source: the paper's ablation."""

    name = "builder"

    def build(self, session: Session) -> Machine:
        """Build the machine of the session's task as one structure."""
        return solo_phase(session)
