"""Watching a sweep: live bars on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from buildarena_cli.client import Client
from buildarena_cli.errors import DONE, PARTIAL
from buildarena_cli.terminal.output import is_terminal, say
from buildarena_client.waiting import sweep_has_stopped

if TYPE_CHECKING:
    from buildarena_client.schemas import SweepView

POLL_S = 0.3
PLAIN_PAUSE_S = 1.7
"""How much longer lines wait for the next, once a job has ended."""
FAULTS = ("errored", "cancelled")
"""Outcomes of jobs that were not scored, as the API spells them."""


def watch_sweep(client: Client, sweep_id: str) -> SweepView:
    """Shows a sweep's progress until every job has ended.

    Returns:
        The sweep as the API shows it then.
    """
    return _watch_bars(client, sweep_id) if is_terminal() else _watch_lines(client, sweep_id)


def exit_code(sweep: SweepView) -> int:
    """0 when every job was scored, 3 when some errored, were cancelled, or had to stop."""
    progress = sweep["progress"]
    faults = any(progress["outcomes"].get(name) for name in FAULTS)
    return PARTIAL if faults or progress["done"] < progress["total"] else DONE


def _watch_bars(client: Client, sweep_id: str) -> SweepView:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.table import Column

    whole = Column(no_wrap=True, min_width=7)
    bars = Progress(
        TextColumn("{task.description}", markup=False, table_column=Column(min_width=14)),
        BarColumn(bar_width=12, table_column=Column(min_width=12)),
        MofNCompleteColumn(table_column=whole),
        TimeElapsedColumn(table_column=whole.copy()),
        TextColumn("left", table_column=Column(min_width=4)),
        TimeRemainingColumn(table_column=whole.copy()),
        # What a narrow terminal has no room for is cut here.
        TextColumn(
            "{task.fields[note]}",
            markup=False,
            table_column=Column(no_wrap=True, overflow="ellipsis", ratio=1),
        ),
        expand=True,
    )
    with bars:
        built = bars.add_task("machines built", total=None, note="")
        scored = bars.add_task("jobs scored", total=None, note="")
        for sweep in client.watch_sweep(sweep_id, poll_s=POLL_S):
            progress = sweep["progress"]
            stages = progress["stages"]
            building = sum(n for name, n in stages.items() if name.startswith("construct"))
            bars.update(
                built,
                total=progress["total"],
                completed=progress["total"] - building,
                note=f"{progress['requests']:,} requests  {_counted(stages)}",
            )
            bars.update(
                scored,
                total=progress["total"],
                completed=progress["done"],
                note=f"${progress['cost_usd']:.2f}  {_counted(progress['outcomes'])}",
            )
    return sweep


def _watch_lines(client: Client, sweep_id: str) -> SweepView:
    shown = ""
    for sweep in client.watch_sweep(sweep_id, poll_s=POLL_S):
        progress = sweep["progress"]
        line = (
            f"{progress['done']}/{progress['total']} jobs ended, "
            f"{progress['requests']:,} requests, ${progress['cost_usd']:.2f}  "
            f"{_counted(progress['outcomes'])}"
        )
        if line != shown:
            say(line)
            shown = line
        if progress["done"] and not sweep_has_stopped(sweep):
            time.sleep(PLAIN_PAUSE_S)
    return sweep


def _counted(jobs: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in sorted(jobs.items()))
