"""Leaderboard mathematics: from ended jobs to ranks, with what is not known about them."""

from buildarena_benchmark.leaderboard.board import Board, BoardQuery, TaskBoard, TrackBoard
from buildarena_benchmark.leaderboard.cells import Cell, summarise
from buildarena_benchmark.leaderboard.comparisons import Duel, TaskDuel, duel
from buildarena_benchmark.leaderboard.latex import cost_table, performance_table, plain_table
from buildarena_benchmark.leaderboard.overall import OverallRow
from buildarena_benchmark.leaderboard.published import (
    PublishedRow,
    published_overall,
    published_rows,
)
from buildarena_benchmark.leaderboard.trials import Trial
from buildarena_benchmark.outcomes import SCORED

__all__ = [
    "SCORED",
    "Board",
    "BoardQuery",
    "Cell",
    "Duel",
    "OverallRow",
    "PublishedRow",
    "TaskBoard",
    "TaskDuel",
    "TrackBoard",
    "Trial",
    "cost_table",
    "duel",
    "performance_table",
    "plain_table",
    "published_overall",
    "published_rows",
    "summarise",
]
