"""Models of several logs, ranked over tasks as our leaderboards rank them."""

from __future__ import annotations

from collections.abc import Iterable

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.leaderboard import BoardQuery, EndedJob, OverallRow, TrackBoard
from buildarena_inspect.errors import LogError
from buildarena_inspect.logs import LoggedSample


def ranked(samples: Iterable[LoggedSample]) -> dict[str, list[OverallRow]]:
    """Who builds best over the tasks of some samples, and who is statistically tied.

    Returns:
        A ranking for each simulator: results of different ones are not compared.

    Raises:
        LogError: One is of a version of its task that this release does not have.
    """
    boards: dict[str, TrackBoard] = {}
    for sample in samples:
        board = boards.setdefault(sample.conditions.simulator, _empty())
        board.put(_ended(_current(sample)))
    return {name: list(board.board(BoardQuery()).overall) for name, board in boards.items()}


def _empty() -> TrackBoard:
    tasks = builtin_tasks()
    return TrackBoard(
        {name: task.version for name, task in tasks.items()},
        {name: task.difficulty for name, task in tasks.items() if task.difficulty},
    )


def _current(sample: LoggedSample) -> LoggedSample:
    version = sample.task_version
    known = builtin_tasks()[sample.conditions.task].version
    if version != known:
        raise LogError(
            f"sample {sample.sample} was built for version {version} of its task, and this "
            f"release ranks {known}"
        )
    return sample


def _ended(sample: LoggedSample) -> EndedJob:
    failed = "construction_failed" if sample.reason else "unsuccessful"
    return EndedJob(
        job_id=sample.uuid,
        task=sample.conditions.task,
        task_version=sample.task_version,
        model=sample.agent,
        configuration=sample.agent,
        outcome="success" if sample.success else failed,
        reason=sample.reason,
        success=sample.success,
        indicator=sample.indicator,
        seed=sample.epoch,
        flags=sample.flags,
        requests=None,
        input_tokens=None,
        output_tokens=None,
        cost_usd=None,
        actions=len(sample.calls),
    )
