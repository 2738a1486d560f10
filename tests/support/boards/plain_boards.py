"""Boards made of every ended job in the plain way."""

from collections.abc import Callable, Iterable, Mapping

from sqlalchemy import select

from buildarena_backend.boards.trials import TRIAL_COLUMNS, TrialFilter, ended_job
from buildarena_backend.process.context import Context
from buildarena_benchmark.leaderboard import (
    Board,
    BoardQuery,
    CellHead,
    CellKey,
    EndedJob,
    choose_cells,
    ranked_board,
    summarise,
)
from buildarena_benchmark.leaderboard import TestCache as ComparedTests


def ended_trials(context: Context) -> list[EndedJob]:
    """Every ended job that can be on a board."""
    query = select(*TRIAL_COLUMNS).where(*TrialFilter().conditions())
    return [ended_job(row) for row in context.store.database.all_rows(query)]


def plain_board(
    trials: Iterable[EndedJob],
    query: BoardQuery,
    versions: Mapping[str, str],
    *,
    inside: Callable[[EndedJob], bool] = lambda _: True,
    is_baseline: Callable[[str], bool] = lambda _: False,
) -> Board:
    """The board of a track's trials."""
    cells: dict[CellKey, list[EndedJob]] = {}
    for trial in trials:
        key = (trial.task, trial.task_version, trial.configuration)
        cells.setdefault(key, []).append(trial)
    ends = {key: [t.finished_at for t in each if t.finished_at] for key, each in cells.items()}
    newest = {key: max(times, default=None) for key, times in ends.items()}
    heads = [CellHead(key=k, model=each[0].model, newest=newest[k]) for k, each in cells.items()]
    chosen = choose_cells(heads, versions, query)
    held = {key: [t for t in found if inside(t)] for key, found in cells.items()}
    return ranked_board(
        chosen,
        lambda key: summarise(held[key]) if held[key] else None,
        {task: sum(len(held[key]) for key in keys) for task, keys in chosen.outdated.items()},
        overall=query.overall,
        tests=ComparedTests(),
        is_baseline=is_baseline,
    )
