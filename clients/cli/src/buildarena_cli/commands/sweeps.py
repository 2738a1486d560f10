"""The commands of sweeps."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.commands.job_lists import listed, show_page
from buildarena_cli.commands.keys import spent
from buildarena_cli.ids import path_of, resolve_id
from buildarena_cli.options import (
    AllOption,
    JsonOption,
    LimitOption,
    MaxCostOption,
    MaxRequestsOption,
    MaxTokensOption,
    ServiceOption,
    SweepId,
    budget_of,
    new_group,
    printed_by,
    to_read,
)
from buildarena_cli.terminal.output import (
    minute_of,
    number,
    print_json,
    print_line,
    print_rows,
    warn,
)
from buildarena_cli.terminal.progress import exit_code, forecast_lines, humanize, watch_sweep
from buildarena_client.client import Client
from buildarena_client.errors import RefusedError

if TYPE_CHECKING:
    from buildarena_client.schemas import BoardPower, Sweep, SweepEstimate, SweepFault

app = new_group("Submit and watch sweeps.")
AGAIN_S = 3
"""Time in which a second Ctrl-C pauses the sweep."""
LIMITS = ("max_cost_usd", "max_tokens", "max_requests")
LIST = {
    "sweep": lambda sweep: sweep["id"],
    "name": lambda sweep: sweep["name"],
    "state": lambda sweep: sweep["state"],
    "ended": lambda sweep: f"{sweep['progress']['done']:,}",
    "jobs": lambda sweep: f"{sweep['progress']['total']:,}",
    "outcomes": lambda sweep: ", ".join(
        f"{n:,} {name}" for name, n in sorted(sweep["progress"]["outcomes"].items())
    ),
    "USD": lambda sweep: number(sweep["progress"]["usage"]["cost_usd"], 2),
    "created": lambda sweep: minute_of(sweep["created_at"]),
}
ESTIMATE = {
    "model": lambda model: model["model"],
    "jobs": lambda model: f"{model['jobs']:,}",
    "requests": lambda model: number(model["usage"]["requests"], 0),
    "tokens in": lambda model: number(model["usage"]["input_tokens"], 0),
    "tokens out": lambda model: number(model["usage"]["output_tokens"], 0),
    "USD": lambda model: number(model["usage"]["cost_usd"], 2),
}


@app.command("run")
def run_sweep(
    file: Annotated[Path, typer.Argument(help="YAML file of the sweep.", callback=to_read)],
    *,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run",
            help="Show the jobs with estimated cost and statistical power; submit nothing.",
        ),
    ] = False,
    detach: Annotated[bool, typer.Option("--detach", help="Submit without waiting.")] = False,
    task: Annotated[list[str] | None, typer.Option(help="Replaces the file's tasks.")] = None,
    model: Annotated[list[str] | None, typer.Option(help="Replaces the file's models.")] = None,
    samples: Annotated[
        int | None, typer.Option(help="Replaces the file's samples or seeds.")
    ] = None,
    seed: Annotated[
        list[int] | None, typer.Option(help="Replaces the file's seeds or samples.")
    ] = None,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    client: ServiceOption,
    as_json: JsonOption = False,
) -> None:
    """Submit a sweep and watch it; running the same file again resumes it."""
    from buildarena_cli.sweep_files import read_sweep

    if samples is not None and seed:
        raise typer.BadParameter("give either --samples or --seed, not both")
    flags = {
        "tasks": task or None,
        "models": model or None,
        "samples": samples,
        "seeds": seed or None,
        "budget": budget_of(max_cost_usd, max_tokens, max_requests),
    }
    sweep = read_sweep(file, flags)
    try:
        estimate = client.estimate_sweep(sweep.content)
        if dry_run:
            (print_json if as_json else _show_estimate)(estimate)
            return
        accepted = client.submit_sweep(sweep.content, resume=True)
    except RefusedError as error:
        raise sweep.refused(error) from error
    if not as_json:
        news = "resumed" if accepted["resumed"] else f"{accepted['added']} of them new"
        print_line(f"{accepted['id']}: {accepted['jobs']} jobs, {news}; {_cost(estimate)}")
    if detach:
        if as_json:
            print_json(accepted)
        return
    raise typer.Exit(exit_code(_watch(client, accepted["id"], as_json=as_json)))


@app.command("list")
@printed_by(lambda page: show_page(LIST, page))
def list_sweeps(*, limit: LimitOption = 20, every: AllOption = False, client: ServiceOption) -> Any:
    """List sweeps, newest first."""
    return listed(client, "/v1/sweeps", limit, every=every)


@app.command("watch")
def watch(sweep_id: SweepId, *, client: ServiceOption, as_json: JsonOption = False) -> None:
    """Watch a sweep until every job has ended; exit code 3 when some errored."""
    sweep_id = resolve_id(client, "sweep", sweep_id)
    raise typer.Exit(exit_code(_watch(client, sweep_id, as_json=as_json)))


@app.command("status")
def show_sweep(sweep_id: SweepId, *, client: ServiceOption, as_json: JsonOption = False) -> None:
    """Show a sweep's progress."""
    sweep_id = resolve_id(client, "sweep", sweep_id)
    sweep = client.sweep(sweep_id)
    if as_json:
        print_json(sweep)
        return
    _show(sweep)
    for fault in client.sweep_faults(sweep_id):
        print_line(_fault(fault))
    if sweep["progress"]["done"] < sweep["progress"]["total"]:
        for line in forecast_lines(client.sweep_forecast(sweep_id)):
            print_line(line)


def _fault(fault: SweepFault) -> str:
    """Return a line about requests that hang or were repeated, or about failed attempts."""
    model, jobs = fault["model"], f"in {fault['jobs']:,} jobs"
    if fault["result"] == "waiting":
        since = datetime.fromisoformat(fault["last_at"])
        minutes = (datetime.now(UTC) - since).total_seconds() / 60
        return f"waiting {minutes:.0f} min for {model} {jobs}"
    kind = "asked again" if fault["result"] == "retried" else humanize(fault["result"])
    detail = f": {fault['detail']}" if fault["detail"] else ""
    return f"{kind} {fault['attempts']:,} x {model} {jobs}{detail}"


def _show(sweep: Sweep) -> None:
    progress = sweep["progress"]
    print_line(f"{sweep['id']} {sweep['name']!r}: {humanize(sweep['state'])}")
    print_line(f"{progress['done']} of {progress['total']} jobs ended")
    for name, count in {**progress["stages"], **progress["outcomes"]}.items():
        print_line(f"  {count:>6}  {humanize(name)}")
    usage = progress["usage"]
    print_line(f"{usage['requests']:,} model requests, ${usage['cost_usd']:.2f}")
    if progress.get("lost_requests"):
        print_line(f"{progress['lost_requests']:,} more may have been paid for: replies were lost")
    if sweep["budget"] is not None:
        print_line(f"budget: {spent(sweep['budget'])}")
    _show_limit(sweep)


@app.command("pause")
@printed_by(_show)
def pause_sweep(sweep_id: SweepId, *, client: ServiceOption) -> Any:
    """Put a sweep's waiting jobs on hold; running jobs continue."""
    return client.post(path_of(client, "sweep", sweep_id, "pause"))


@app.command("resume")
@printed_by(_show)
def resume_sweep(
    sweep_id: SweepId,
    *,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    client: ServiceOption,
) -> Any:
    """Resume a sweep that was paused, or one whose budget is used up, with a larger budget."""
    body = {"budget": budget_of(max_cost_usd, max_tokens, max_requests)}
    return client.post(path_of(client, "sweep", sweep_id, "resume"), body)


@app.command("budget")
@printed_by(_show)
def set_budget(
    sweep_id: SweepId,
    *,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    client: ServiceOption,
) -> Any:
    """Set limits of a sweep's budget, also while it runs; other limits remain.

    Previous spending counts. A sweep whose budget was used up continues.
    """
    budget = budget_of(max_cost_usd, max_tokens, max_requests)
    if budget is None:
        raise typer.BadParameter("give --max-cost-usd, --max-tokens or --max-requests")
    path = path_of(client, "sweep", sweep_id)
    before = client.get(path)["budget"] or {}
    limits = {name: before[name] for name in LIMITS if before.get(name) is not None}
    return client.put(f"{path}/budget", limits | budget)


@app.command("retry")
@printed_by(_show)
def retry_sweep(sweep_id: SweepId, *, client: ServiceOption) -> Any:
    """Queue a sweep's errored jobs again where they failed; scored ones are never redone."""
    return client.post(path_of(client, "sweep", sweep_id, "retry"))


@app.command("cancel")
@printed_by(_show)
def cancel_sweep(sweep_id: SweepId, *, client: ServiceOption) -> Any:
    """Cancel a sweep's unfinished jobs, except those that another sweep has claimed."""
    return client.post(path_of(client, "sweep", sweep_id, "cancel"))


def _show_estimate(estimate: SweepEstimate) -> None:
    print_rows(
        ESTIMATE,
        estimate["models"],
        title=f"{estimate['jobs']:,} jobs, {_cost(estimate)}",
        notes=[
            "From the mean figures that the paper reports; models without a known price: -",
            *_power(estimate["power"]),
        ],
    )


def _cost(estimate: SweepEstimate) -> str:
    maximum = estimate["max_cost_usd"]
    limit = "without a limit" if maximum is None else f"at most ${maximum:,.2f}"
    return f"about ${estimate['cost_usd']:,.2f}, {limit}"


def _power(power: BoardPower) -> list[str]:
    """Return the statistical power of the sweep's board as text."""
    needed = power["samples_for_10pp_effect"]
    on_a_task = power["min_detectable_effect_per_task"]
    return [
        f"{power['trials']} trials of each model on each task distinguish success rates from 50 %",
        f"  on a task {_by(on_a_task)}, over all tasks {_by(power['overall'])}",
        f"{needed:,} trials of each model on each task show 10 points over all tasks",
    ]


def _by(rise: float | None) -> str:
    return "not at all" if rise is None else f"if it is {100 * rise:.0f} points more"


def _show_limit(sweep: Sweep) -> None:
    if sweep["state"] == "budget_exhausted":
        print_line(
            f"The budget is used up: `buildarena sweep budget {sweep['id']} --max-cost-usd …` (or "
            "--max-tokens, --max-requests) raises it, and the sweep continues."
        )


def _watch(client: Client, sweep_id: str, *, as_json: bool) -> Sweep:
    try:
        sweep = client.wait_for_sweep(sweep_id) if as_json else watch_sweep(client, sweep_id)
    except KeyboardInterrupt:
        _stop_watching(client, sweep_id)
        raise
    (print_json if as_json else _show_limit)(sweep)
    return sweep


def _stop_watching(client: Client, sweep_id: str) -> None:
    """Report that the sweep continues; another Ctrl-C while this waits pauses it."""
    try:
        warn(
            "\nThe sweep continues without this command, and spends. Watch it: `buildarena sweep "
            f"watch {sweep_id}`; pause it: `buildarena sweep pause {sweep_id}`; cancel it: "
            f"`buildarena sweep cancel {sweep_id}`. Press Ctrl-C again within {AGAIN_S} s to "
            "pause it now."
        )
        time.sleep(AGAIN_S)
    except KeyboardInterrupt:
        client.pause_sweep(sweep_id)
        warn(f"It is paused: `buildarena sweep resume {sweep_id}` continues it.")
