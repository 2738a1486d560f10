"""Watching a sweep."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from buildarena_cli.errors import DONE, PARTIAL
from buildarena_cli.terminal.output import is_terminal, minute_of, print_line
from buildarena_client.client import Client
from buildarena_client.endpoints.sweeps import sweep_has_stopped

if TYPE_CHECKING:
    from buildarena_client.schemas import Forecast, Sweep

POLL_S = 0.3
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


def humanize(state: str) -> str:
    """Return a state, stage or outcome in plain words."""
    return WORDS.get(state, state.replace("_", " "))


def forecast_lines(forecast: Forecast) -> list[str]:
    """Return a sweep's forecast as lines to print."""
    lines = []
    rate, end = forecast["jobs_per_minute"], forecast["finish_at"]
    if rate is not None and end is not None:
        pace = f"jobs left: {forecast['remaining_jobs']:,}, at {rate:.2g} a minute"
        lines.append(f"{pace}; ends about {minute_of(end)} UTC")
    unknown = ", ".join(forecast["unknown_models"])
    but = f", without {unknown}, of which nothing has ended yet" if unknown else ""
    if forecast["total_cost_usd"] or not unknown:
        left, total = forecast["remaining_cost_usd"], forecast["total_cost_usd"]
        lines.append(f"about ${left:.2f} still to spend, ${total:.2f} in all{but}")
    if forecast["lacking_budget_usd"]:
        lines.append(f"the budget lacks about ${forecast['lacking_budget_usd']:.2f} for that")
    return lines


def watch_sweep(client: Client, sweep_id: str) -> Sweep:
    """Show a sweep's progress until every job has ended: a bar on a terminal, lines elsewhere.

    Returns:
        The sweep as the API shows it then.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    on_terminal, shown = is_terminal(), ""
    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    text = TextColumn("{task.description}", markup=False)
    with Progress(*columns, text, disable=not on_terminal) as bars:
        bar = bars.add_task("", total=None)
        for sweep in client.watch_sweep(sweep_id, poll_s=POLL_S):
            progress = sweep["progress"]
            line = (
                f"{progress['usage']['requests']:,} requests, "
                f"${progress['usage']['cost_usd']:.2f}  "
                f"{_counted(progress['outcomes'])}"
            )
            bars.update(bar, total=progress["total"], completed=progress["done"], description=line)
            line = f"{progress['done']}/{progress['total']} jobs ended, {line}"
            if on_terminal:
                continue
            if line != shown:
                print_line(line)
                shown = line
            if progress["done"] and not sweep_has_stopped(sweep):
                time.sleep(PLAIN_PAUSE_S)
    return sweep


def exit_code(sweep: Sweep) -> int:
    """0 when every job was scored, 3 when some errored, were cancelled, or had to stop."""
    progress = sweep["progress"]
    faults = any(progress["outcomes"].get(name) for name in FAULTS)
    return PARTIAL if faults or progress["done"] < progress["total"] else DONE


def _counted(jobs: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in sorted(jobs.items()))
