"""Finds workflows by name."""

from __future__ import annotations

from buildarena_pipeline.errors import PermanentFaultError
from buildarena_worker.workflow.base import Workflow
from buildarena_worker.workflow.builder import Builder
from buildarena_worker.workflow.five_role import FiveRole
from buildarena_worker.workflow.guidance_builder import GuidanceBuilder

BUILTIN: tuple[type[Workflow], ...] = (FiveRole, GuidanceBuilder, Builder)


def find_workflow(name: str) -> Workflow:
    """A workflow with this name.

    Raises:
        PermanentFaultError: There is none.
    """
    known = {workflow.name: workflow for workflow in BUILTIN}
    if name not in known:
        raise PermanentFaultError(
            f"no workflow {name!r}; there are {', '.join(known)}", reason="unknown_workflow"
        )
    return known[name]()
