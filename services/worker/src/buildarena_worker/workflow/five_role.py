"""The default workflow: planner, drafter, reviewer, builder and guidance."""

from __future__ import annotations

from buildarena_geometry import Machine
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.base import require_started
from buildarena_worker.workflow.phases import (
    assemble_phase,
    build_phase,
    draft_phase,
    plan_phase,
    refine_phase,
)


class FiveRole:
    """Plan, then draft, build and refine each sub-structure, then assemble.

    Source: the paper's section on the agentic workflow.
    """

    name = "five-role"

    def build(self, session: Session) -> Machine:
        """Builds the machine of the session's task."""
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
