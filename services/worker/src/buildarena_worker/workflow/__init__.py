"""Workflows: who speaks when, from the task to the finished machine."""

from buildarena_worker.workflow.base import Workflow
from buildarena_worker.workflow.registry import Workflows

__all__ = ["Workflow", "Workflows"]
