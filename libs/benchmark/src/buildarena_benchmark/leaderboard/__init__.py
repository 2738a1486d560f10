"""Leaderboard mathematics: from ended jobs to ranks, with what is not known about them."""

from buildarena_benchmark.leaderboard.board import Board, BoardQuery, TaskBoard, TrackBoard
from buildarena_benchmark.leaderboard.cells import Cell, counted_trials, summarise
from buildarena_benchmark.leaderboard.comparisons import Comparison, TaskComparison, compare_models
from buildarena_benchmark.leaderboard.ended_jobs import EndedJob
from buildarena_benchmark.leaderboard.figures import FailureRow, cost_bins, failure_rows
from buildarena_benchmark.leaderboard.latex import cost_table, performance_table, plain_table
from buildarena_benchmark.leaderboard.overall import OverallRow
from buildarena_benchmark.leaderboard.published import (
    PublishedRow,
    published_overall,
    published_rows,
)
from buildarena_benchmark.outcomes import SCORED

__all__ = [
    "SCORED",
    "Board",
    "BoardQuery",
    "Cell",
    "Comparison",
    "EndedJob",
    "FailureRow",
    "OverallRow",
    "PublishedRow",
    "TaskBoard",
    "TaskComparison",
    "TrackBoard",
    "compare_models",
    "cost_bins",
    "cost_table",
    "counted_trials",
    "failure_rows",
    "performance_table",
    "plain_table",
    "published_overall",
    "published_rows",
    "summarise",
]
