"""BuildArena's tasks in Inspect."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from buildarena_inspect.task_factory import TASKS

__all__ = ["TASKS"]
