"""Models of several logs, ranked over tasks as our leaderboards rank them."""

from __future__ import annotations

from collections.abc import Iterable

from buildarena_benchmark import builtin_tasks
from buildarena_benchmark.leaderboard import BoardQuery, EndedJob, OverallRow, TrackBoard
from buildarena_inspect.errors import LogError
from buildarena_inspect.logs import LoggedSample


def ranked(samples: Iterable[LoggedSample]) -> list[OverallRow]:
    """Who builds best over the tasks of some samples, and who is statistically tied.

    Raises:
        LogError: They are of several simulators, or of versions of tasks that this release has not.
    """
    tasks = builtin_tasks()
    board = TrackBoard(
        {name: task.version for name, task in tasks.items()},
        {name: task.difficulty for name, task in tasks.items() if task.difficulty},
    )
    simulators = set()
    for sample in samples:
        version = str(sample.figures["task_version"])
        known = tasks[sample.conditions.task].version
        if version != known:
            raise LogError(
                f"sample {sample.sample} was built for version {version} of its task, and this "
                f"release ranks {known}"
            )
        simulators.add(sample.conditions.simulator)
        board.put(_ended(sample))
    if len(simulators) > 1:
        raise LogError(f"logs of {' and '.join(sorted(simulators))} are not ranked together")
    return list(board.board(BoardQuery()).overall)


def _ended(sample: LoggedSample) -> EndedJob:
    success = bool(sample.figures["success"])
    reason = sample.figures.get("reason")
    outcome = "success" if success else "construction_failed" if reason else "unsuccessful"
    return EndedJob(
        job_id=sample.uuid,
        task=sample.conditions.task,
        task_version=str(sample.figures["task_version"]),
        model=sample.agent,
        configuration=sample.agent,
        outcome=outcome,
        reason=None if reason is None else str(reason),
        success=success,
        indicator=float(sample.figures["indicator"]),
        seed=sample.epoch,
        flags=tuple(sample.figures["flags"]),
        requests=None,
        input_tokens=None,
        output_tokens=None,
        cost_usd=None,
        actions=len(sample.calls),
    )
