"""Workflows: who speaks when, from the task to the finished machine."""

from buildarena_worker.workflow.registry import Workflow, Workflows

__all__ = ["Workflow", "Workflows"]
