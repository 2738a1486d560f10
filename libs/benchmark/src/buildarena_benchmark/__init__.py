"""Tasks, scorers, statistics and leaderboard mathematics of BuildArena."""

from buildarena_geometry import kernels as kernels  # before numpy

# isort: split

from typing import Final

from buildarena_benchmark.constraints import broken_constraint, edit_limit_violation
from buildarena_benchmark.errors import BenchmarkError, SourceError, TaskError, ValidationIssue
from buildarena_benchmark.robustness import Robustness, robustness
from buildarena_benchmark.scores import failed_score, score
from buildarena_benchmark.scoring.scorer import Score
from buildarena_benchmark.tasks.loading import (
    builtin_tasks,
    load_task,
    paper_tasks,
    parse_custom_task,
    parse_task,
    references,
)
from buildarena_benchmark.tasks.task import Task

CANARY: Final = (
    "BuildArena benchmark data, not for training corpora: "
    "canary 3ab839c7-e533-462b-9729-71495c1ee1f6"
)
"""Text by which benchmark data is recognised in a training corpus.

It is in the sources of statements and of the expert's designs, in documents that show sessions, and
in each row of a dataset; never in what a model reads. A model that completes its number has seen
them."""

__all__ = [
    "CANARY",
    "BenchmarkError",
    "Robustness",
    "Score",
    "SourceError",
    "Task",
    "TaskError",
    "ValidationIssue",
    "broken_constraint",
    "builtin_tasks",
    "edit_limit_violation",
    "failed_score",
    "load_task",
    "paper_tasks",
    "parse_custom_task",
    "parse_task",
    "references",
    "robustness",
    "score",
]
