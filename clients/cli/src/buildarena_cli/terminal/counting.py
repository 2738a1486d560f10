"""How far a command has come that does many things: a bar on a terminal, nothing elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from buildarena_cli.terminal.output import is_terminal


@contextmanager
def counted(what: str, total: int) -> Iterator[Callable[[], None]]:
    """Yields what is called after each thing; any thread may.

    Args:
        what: What is done, in a word or two.
        total: How many things there are, about.
    """
    if not is_terminal() or not total:
        yield lambda: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
    from rich.progress import TimeRemainingColumn as Left

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TextColumn("left"), Left()) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)
        bar.update(task, total=bar.tasks[0].completed)
