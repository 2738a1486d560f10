"""The default workflow: planner, drafter, reviewer, builder and guidance."""

from __future__ import annotations

from buildarena_geometry import Machine
from buildarena_worker.session.session import Session
from buildarena_worker.workflow.base import require_started
from buildarena_worker.workflow.stages import (
    assemble_stage,
    build_stage,
    draft_stage,
    plan_stage,
    refine_stage,
)


class FiveRole:
    """Plan, then draft, build and refine each sub-structure, then assemble.

    Source: the paper's section on the agentic workflow.
    """

    name = "five-role"

    def build(self, session: Session) -> Machine:
        """Builds the machine of the session's task."""
        plan = plan_stage(session)
        machines: dict[str, Machine] = {}
        for part in plan.sub_structures:
            blueprint = draft_stage(session, plan, part)
            machine = build_stage(session, part, blueprint)
            require_started(machine)
            refine_stage(session, machine, part, blueprint)
            machines[part.name] = machine
        if len(machines) == 1:
            return next(iter(machines.values()))
        return assemble_stage(session, plan, machines)
