"""Watching a sweep: live bars on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from buildarena_cli.client import Client, UnreachableError
from buildarena_cli.errors import DONE, PARTIAL
from buildarena_cli.terminal.output import is_terminal, minute_of, say
from buildarena_client.endpoints.sweeps import sweep_has_stopped

if TYPE_CHECKING:
    from buildarena_client.schemas import ForecastView, SweepView

POLL_S = 0.3
FORECAST_S = 5.0
"""Seconds between two looks at the forecast, which hardly moves in them."""
PLAIN_PAUSE_S = 1.7
"""How much longer lines wait for the next, once a job has ended."""
FAULTS = ("errored", "cancelled")
"""Outcomes of jobs that were not scored, as the API spells them."""


WORDS = {
    "construct queued": "waiting to be built",
    "construct running": "being built",
    "construct on_hold": "on hold before they are built",
    "simulate queued": "waiting for their trial",
    "simulate running": "in their trial",
    "simulate on_hold": "on hold before their trial",
    "budget_exhausted": "stopped, as its budget is used up",
}
"""What the API's names of states mean; the dashboard has the same."""


def in_plain_words(state: str) -> str:
    """What a state, stage or outcome is called where people read it."""
    return WORDS.get(state, state.replace("_", " "))


def forecast_lines(forecast: ForecastView) -> list[str]:
    """What is to come of a sweep, as lines to print."""
    lines = []
    rate, end = forecast["jobs_per_minute"], forecast["ends_at"]
    if rate is not None and end is not None:
        lines.append(
            f"{forecast['jobs_left']:,} jobs left at {rate:.2g} a minute: "
            f"ends about {minute_of(end)} UTC"
        )
    unknown = ", ".join(forecast["unknown_models"])
    but = f", without {unknown}, of which nothing has ended yet" if unknown else ""
    if forecast["cost_usd_total"] or not unknown:
        left, total = forecast["cost_usd_left"], forecast["cost_usd_total"]
        lines.append(f"about ${left:.2f} still to spend, ${total:.2f} in all{but}")
    if forecast["budget_usd_short"]:
        lines.append(f"the budget lacks about ${forecast['budget_usd_short']:.2f} for that")
    return lines


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
    )
    from rich.table import Column

    whole = Column(no_wrap=True, min_width=7)
    bars = Progress(
        TextColumn("{task.description}", markup=False, table_column=Column(min_width=14)),
        BarColumn(bar_width=12, table_column=Column(min_width=12)),
        MofNCompleteColumn(table_column=whole),
        TimeElapsedColumn(table_column=whole.copy()),
        # What a narrow terminal has no room for is cut here.
        TextColumn(
            "{task.fields[note]}",
            markup=False,
            table_column=Column(no_wrap=True, overflow="ellipsis", ratio=1),
        ),
        expand=True,
    )
    ahead = _Ahead(client, sweep_id)
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
                note=f"${progress['cost_usd']:.2f}{ahead.note()}  {_counted(progress['outcomes'])}",
            )
    return sweep


class _Ahead:
    """The forecast of a sweep that is watched, asked for now and then."""

    def __init__(self, client: Client, sweep_id: str) -> None:
        self._client, self._sweep_id = client, sweep_id
        self._asked_at = time.monotonic()
        self._note = ""

    def note(self) -> str:
        """When it ends and what it comes to cost, as far as that is known."""
        if time.monotonic() - self._asked_at < FORECAST_S:
            return self._note
        self._asked_at = time.monotonic()
        try:
            forecast = self._client.sweep_forecast(self._sweep_id)
        except UnreachableError:
            return self._note
        end = forecast["ends_at"]
        about = "" if end is None else f", ends about {minute_of(end)} UTC"
        self._note = f" of about ${forecast['cost_usd_total']:.2f}{about}"
        return self._note


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
