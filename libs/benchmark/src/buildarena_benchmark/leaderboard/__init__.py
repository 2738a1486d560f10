"""Leaderboard mathematics."""

from buildarena_benchmark.leaderboard.rows import TaskRow, Trial, task_rows

__all__ = ["TaskRow", "Trial", "task_rows"]
