"""BuildArena's tasks in Inspect."""

from buildarena_inspect.tasks import TASKS

__all__ = ["TASKS"]
