"""Workflows: the order in which roles speak, from the task to the finished machine."""

from buildarena_worker.workflow.registry import Workflow, Workflows

__all__ = ["Workflow", "Workflows"]
