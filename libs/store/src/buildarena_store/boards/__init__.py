"""What leaderboards are made of: cells with their tallies, single trials, and why they changed."""

from buildarena_store.boards.cells import BoardCells, CellFeed
from buildarena_store.boards.kept import Mark
from buildarena_store.boards.reading import BoardChange, Boards, Round
from buildarena_store.boards.tallying import CellRecord
from buildarena_store.boards.trials import CellId, TrialFilter

__all__ = [
    "BoardCells",
    "BoardChange",
    "Boards",
    "CellFeed",
    "CellId",
    "CellRecord",
    "Mark",
    "Round",
    "TrialFilter",
]
