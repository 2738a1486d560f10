"""The board of one track: which cells it has, and how they rank."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

from buildarena_benchmark.leaderboard.cells import Cell
from buildarena_benchmark.leaderboard.overall import OverallRow, label_rows, overall_rows
from buildarena_benchmark.leaderboard.standings import Standing, TestCache, standings

CellKey = tuple[str, str, str]
"""Task, task version, configuration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardQuery:
    """Selection of a board's trials. None means all.

    Attributes:
        overall: Tasks of the overall ranking, if they are on the board.
    """

    tasks: frozenset[str] | None = None
    models: frozenset[str] | None = None
    overall: frozenset[str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RankedCell:
    """A cell with its place on its task; None without counted trials, and for baselines."""

    cell: Cell
    label: str
    rank: int | None
    rank_low: int | None
    rank_high: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskBoard:
    """All configurations on one version of one task, the best first.

    Attributes:
        outdated: Ended jobs of other versions of the task, which are left out.
    """

    task: str
    version: str
    outdated: int
    rows: Sequence[RankedCell]


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A track's boards, one for each task, and the ranking over them.

    Attributes:
        overall: The ranking over `ranked`.
        ranked: Names of the tasks of the overall ranking.
    """

    tasks: Sequence[TaskBoard]
    overall: Sequence[OverallRow]
    ranked: Sequence[str] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CellHead:
    """Fields that decide whether a cell is on a board.

    Attributes:
        key: Task, task version, configuration.
    """

    key: CellKey
    model: str
    newest: datetime | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenCells:
    """The cells of a board.

    Attributes:
        shown: Cells by task and version, in the board's order.
        outdated: Cells of other versions, by task.
    """

    shown: Mapping[tuple[str, str], Sequence[CellKey]]
    outdated: Mapping[str, Sequence[CellKey]]


def choose_cells(
    heads: Iterable[CellHead], versions: Mapping[str, str], query: BoardQuery
) -> ChosenCells:
    """Return the cells that a query is about; each task is shown in one version.

    Args:
        heads: All cells of the track.
        versions: Current version of each known task; of another task the newest one counts.
    """
    by_task: dict[str, dict[str, list[CellHead]]] = {}
    for head in heads:
        if query.tasks is not None and head.key[0] not in query.tasks:
            continue
        if query.models is not None and head.model not in query.models:
            continue
        by_task.setdefault(head.key[0], {}).setdefault(head.key[1], []).append(head)
    shown: dict[tuple[str, str], list[CellKey]] = {}
    outdated: dict[str, list[CellKey]] = {}
    places = {task: place for place, task in enumerate(versions)}
    for task in sorted(by_task, key=lambda t: (places.get(t, len(places)), t)):
        by_version = by_task[task]
        version = versions.get(task, "")
        if version not in by_version:
            version = max(by_version, key=lambda v: (_newest(by_version[v]), v))
        shown[task, version] = sorted(head.key for head in by_version[version])
        outdated[task] = [head.key for v in by_version if v != version for head in by_version[v]]
    return ChosenCells(shown=shown, outdated=outdated)


def ranked_board(
    chosen: ChosenCells,
    cell_of: Callable[[CellKey], Cell | None],
    outdated: Mapping[str, int],
    *,
    overall: frozenset[str] | None,
    tests: TestCache,
    is_baseline: Callable[[str], bool],
) -> Board:
    """Rank chosen cells.

    Args:
        cell_of: A cell's summary; None if the filter excludes all of it.
        outdated: Ended jobs of other versions, by task.
        overall: Tasks of the overall ranking; None means all, as it does if none of these is on the
            board.
        is_baseline: Whether a model is for comparison only, and has no rank.
    """
    cells: dict[str, dict[str, Cell]] = {}
    for (task, _), keys in chosen.shown.items():
        row = {key[2]: cell_of(key) for key in keys}
        cells[task] = {name: cell for name, cell in row.items() if cell is not None}

    tasks = frozenset(task for task, row in cells.items() if row)
    scope = tasks if overall is None else (overall & tasks or tasks)
    labels = label_rows(cell for row in cells.values() for cell in row.values())
    ranks = standings(cells, scope.__contains__, tests, is_baseline)
    boards = [
        TaskBoard(
            task=task,
            version=version,
            outdated=outdated.get(task, 0),
            rows=_rank(cells[task], ranks.tasks.get(task), labels),
        )
        for task, version in chosen.shown
        if cells[task]
    ]
    filled = {task: row for task, row in cells.items() if task in scope}
    return Board(
        tasks=boards,
        overall=overall_rows(filled, ranks.overall, labels),
        ranked=tuple(filled),
    )


def _newest(heads: Sequence[CellHead]) -> float:
    return max(head.newest.timestamp() if head.newest else 0.0 for head in heads)


def _rank(
    cells: Mapping[str, Cell], standing: Standing | None, labels: Mapping[str, str]
) -> list[RankedCell]:
    places = standing.places if standing else {}

    def order(cell: Cell) -> tuple[float, float, float, str, str]:
        rank, _, mean_rank = places.get(cell.configuration, (math.inf, 0, 0.0))
        return rank, mean_rank, -(cell.success_rate or 0.0), cell.model, cell.configuration

    rows = []
    for cell in sorted(cells.values(), key=order):
        rank, high, _ = places.get(cell.configuration, (None, None, None))
        label = labels[cell.configuration]
        rows.append(RankedCell(cell=cell, label=label, rank=rank, rank_low=rank, rank_high=high))
    return rows
