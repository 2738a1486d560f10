"""Leaderboard mathematics: from ended jobs to ranks, with their uncertainty."""

from buildarena_benchmark.leaderboard.board import (
    Board,
    BoardQuery,
    CellHead,
    CellKey,
    ChosenCells,
    RankedCell,
    choose_cells,
    ranked_board,
)
from buildarena_benchmark.leaderboard.cells import (
    Cell,
    CellFigures,
    CellName,
    summarise,
    summarise_tallies,
)
from buildarena_benchmark.leaderboard.comparisons import TaskComparison, compare_models
from buildarena_benchmark.leaderboard.ended_jobs import EndedJob
from buildarena_benchmark.leaderboard.latex import cost_table, performance_table, plain_table
from buildarena_benchmark.leaderboard.overall import OverallRow
from buildarena_benchmark.leaderboard.published import published_rows
from buildarena_benchmark.leaderboard.standings import TestCache
from buildarena_benchmark.leaderboard.tallies import UNKNOWN_TOKENS, Tally, Total
from buildarena_benchmark.leaderboard.verdict import RankingVerdict, verdict_of
from buildarena_benchmark.outcomes import SCORED

__all__ = [
    "SCORED",
    "UNKNOWN_TOKENS",
    "Board",
    "BoardQuery",
    "Cell",
    "CellFigures",
    "CellHead",
    "CellKey",
    "CellName",
    "ChosenCells",
    "EndedJob",
    "OverallRow",
    "RankedCell",
    "RankingVerdict",
    "Tally",
    "TaskComparison",
    "TestCache",
    "Total",
    "choose_cells",
    "compare_models",
    "cost_table",
    "performance_table",
    "plain_table",
    "published_rows",
    "ranked_board",
    "summarise",
    "summarise_tallies",
    "verdict_of",
]
