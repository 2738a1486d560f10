"""Objects that Inspect loads by the entry points `buildarena` and `buildarena_inspect`."""

from buildarena_inspect.metrics import indicator_by_task, mean_rank, success_interval
from buildarena_inspect.roles import five_roles
from buildarena_inspect.scorers import indicator, reward, success
from buildarena_inspect.solvers import react_builder, workbench
from buildarena_inspect.task_factory import TASKS

__all__ = [
    "TASKS",
    "five_roles",
    "indicator",
    "indicator_by_task",
    "mean_rank",
    "react_builder",
    "reward",
    "success",
    "success_interval",
    "workbench",
]
