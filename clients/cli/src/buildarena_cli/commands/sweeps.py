"""The commands of sweeps."""

from __future__ import annotations

import time
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.client import Client, RefusedError, at
from buildarena_cli.commands.job_lists import gathered, show_cursor
from buildarena_cli.commands.keys import spent
from buildarena_cli.ids import resolve_id
from buildarena_cli.options import (
    DEFAULT_URL,
    AfterOption,
    AllOption,
    JsonOption,
    MaxCostOption,
    MaxRequestsOption,
    MaxTokensOption,
    SweepId,
    UrlOption,
    budget_of,
    new_group,
    to_read,
)
from buildarena_cli.terminal.output import minute_of, number, print_json, print_table, say, warn
from buildarena_cli.terminal.progress import exit_code, forecast_lines, in_plain_words, watch_sweep

if TYPE_CHECKING:
    from buildarena_client.schemas import BoardPower, Sweep, SweepEstimate, Trouble

app = new_group("Submit and watch sweeps.")
AGAIN_S = 3
"""Time in which a second Ctrl-C pauses the sweep."""
LIMITS = ("max_cost_usd", "max_tokens", "max_requests")

MAX_LIMIT = 100
LIST = ("sweep", "name", "state", "ended", "jobs", "outcomes", "USD", "created")
ESTIMATE = ("model", "jobs", "requests", "tokens in", "tokens out", "USD")


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
    task: Annotated[
        list[str] | None,
        typer.Option("--task", help="Replaces the file's tasks."),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option("--model", help="Replaces the file's models."),
    ] = None,
    samples: Annotated[
        int | None, typer.Option("--samples", help="Replaces the file's samples or seeds.")
    ] = None,
    seed: Annotated[
        list[int] | None,
        typer.Option("--seed", help="Replaces the file's seeds or samples."),
    ] = None,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    url: UrlOption = DEFAULT_URL,
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
    client, sweep = Client(url), read_sweep(file, flags)
    try:
        if dry_run:
            _show_estimate(client.estimate_sweep(sweep.content), as_json=as_json)
            return
        estimate = client.estimate_sweep(sweep.content)
        accepted = client.submit_sweep(sweep.content, resume=True)
    except RefusedError as error:
        raise sweep.refused(error) from error
    if not as_json:
        news = "resumed" if accepted["resumed"] else f"{accepted['added']} of them new"
        say(f"{accepted['id']}: {accepted['jobs']} jobs, {news}; {_cost(estimate)}")
    if detach:
        if as_json:
            print_json(accepted)
        return
    raise typer.Exit(exit_code(_watch(client, accepted["id"], as_json=as_json)))


@app.command("list")
def list_sweeps(
    *,
    limit: Annotated[int, typer.Option(help="Rows at most.", min=1, max=MAX_LIMIT)] = 20,
    after: AfterOption = None,
    every: AllOption = False,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """List sweeps, newest first."""
    pages = Client(url).pages("/v1/sweeps", cursor=after, limit=MAX_LIMIT if every else limit)
    page = gathered(pages, every=every)
    if as_json:
        print_json(page)
        return
    rows = [_row(sweep) for sweep in page["data"]]
    print_table(LIST, rows, numeric=("ended", "jobs", "USD"))
    show_cursor(page)


@app.command("watch")
def watch(sweep_id: SweepId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Watch a sweep until every job has ended; exit code 3 when some errored."""
    client = Client(url)
    sweep_id = resolve_id(client, "sweep", sweep_id)
    raise typer.Exit(exit_code(_watch(client, sweep_id, as_json=as_json)))


@app.command("status")
def show_sweep(
    sweep_id: SweepId,
    *,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show a sweep's progress."""
    client = Client(url)
    sweep_id = resolve_id(client, "sweep", sweep_id)
    sweep = client.sweep(sweep_id)
    _show(sweep, as_json=as_json)
    if as_json:
        return
    for trouble in client.sweep_troubles(sweep_id):
        say(_trouble(trouble))
    if sweep["progress"]["done"] < sweep["progress"]["total"]:
        for line in forecast_lines(client.sweep_forecast(sweep_id)):
            say(line)


def _trouble(trouble: Trouble) -> str:
    """Return a line about requests that hang or were repeated, or about failed attempts."""
    model, jobs = trouble["model"], f"in {trouble['jobs']:,} jobs"
    if trouble["result"] == "waiting":
        since = datetime.fromisoformat(trouble["last_at"])
        minutes = (datetime.now(UTC) - since).total_seconds() / 60
        return f"waiting {minutes:.0f} min for {model} {jobs}"
    kind = "asked again" if trouble["result"] == "retried" else in_plain_words(trouble["result"])
    detail = f": {trouble['detail']}" if trouble["detail"] else ""
    return f"{kind} {trouble['attempts']:,} x {model} {jobs}{detail}"


@app.command("pause")
def pause_sweep(
    sweep_id: SweepId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Put a sweep's waiting jobs on hold; running jobs continue."""
    _change(url, sweep_id, "pause", as_json=as_json)


@app.command("resume")
def resume_sweep(
    sweep_id: SweepId,
    *,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Resume a sweep that was paused, or one whose budget is used up, with a larger budget."""
    budget = budget_of(max_cost_usd, max_tokens, max_requests)
    body = {"budget": budget}
    _change(url, sweep_id, "resume", body, as_json=as_json)


@app.command("budget")
def set_budget(
    sweep_id: SweepId,
    *,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Set limits of a sweep's budget, also while it runs; other limits remain.

    Previous spending counts. A sweep whose budget was used up continues.
    """
    budget = budget_of(max_cost_usd, max_tokens, max_requests)
    if budget is None:
        raise typer.BadParameter("give --max-cost-usd, --max-tokens or --max-requests")
    client = Client(url)
    sweep_id = resolve_id(client, "sweep", sweep_id)
    before: Mapping[str, Any] = client.sweep(sweep_id)["budget"] or {}
    limits = {name: before[name] for name in LIMITS if before.get(name) is not None}
    _show(client.put(at("sweeps", sweep_id, "budget"), limits | budget), as_json=as_json)


@app.command("retry")
def retry_sweep(
    sweep_id: SweepId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Queue a sweep's errored jobs again where they failed; scored ones are never redone."""
    _change(url, sweep_id, "retry", as_json=as_json)


@app.command("cancel")
def cancel_sweep(
    sweep_id: SweepId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Cancel a sweep's unfinished jobs, except those that another sweep has claimed."""
    _change(url, sweep_id, "cancel", as_json=as_json)


def _row(sweep: dict[str, Any]) -> list[str]:
    progress = sweep["progress"]
    return [
        sweep["id"],
        sweep["name"],
        sweep["state"],
        f"{progress['done']:,}",
        f"{progress['total']:,}",
        ", ".join(f"{n:,} {name}" for name, n in sorted(progress["outcomes"].items())),
        number(progress["usage"]["cost_usd"], 2),
        minute_of(sweep["created_at"]),
    ]


def _change(
    url: str, sweep_id: str, verb: str, body: dict[str, Any] | None = None, *, as_json: bool
) -> None:
    client = Client(url)
    path = at("sweeps", resolve_id(client, "sweep", sweep_id), verb)
    _show(client.post(path, body or {}), as_json=as_json)


def _show(sweep: Sweep, *, as_json: bool) -> None:
    if as_json:
        print_json(sweep)
        return
    progress = sweep["progress"]
    say(f"{sweep['id']} {sweep['name']!r}: {in_plain_words(sweep['state'])}")
    say(f"{progress['done']} of {progress['total']} jobs ended")
    for name, count in {**progress["stages"], **progress["outcomes"]}.items():
        say(f"  {count:>6}  {in_plain_words(name)}")
    usage = progress["usage"]
    say(f"{usage['requests']:,} model requests, ${usage['cost_usd']:.2f}")
    if progress.get("lost_requests"):
        say(f"{progress['lost_requests']:,} more may have been paid for: their replies were lost")
    if sweep["budget"] is not None:
        say(f"budget: {spent(sweep['budget'])}")
    _show_limit(sweep)


def _show_estimate(estimate: SweepEstimate, *, as_json: bool) -> None:
    if as_json:
        print_json(estimate)
        return
    print_table(
        ESTIMATE,
        [
            (
                model["model"],
                f"{model['jobs']:,}",
                number(model["usage"]["requests"], 0),
                number(model["usage"]["input_tokens"], 0),
                number(model["usage"]["output_tokens"], 0),
                number(model["usage"]["cost_usd"], 2),
            )
            for model in estimate["models"]
        ],
        numeric=ESTIMATE[1:],
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
    needed = power["trials_for_ten_points"]
    return [
        f"{power['trials']} trials of each model on each task distinguish success rates from 50 %",
        f"  on a task {_by(power['on_a_task'])}, over all tasks {_by(power['overall'])}",
        f"{needed:,} trials of each model on each task show 10 points over all tasks",
    ]


def _by(rise: float | None) -> str:
    return "not at all" if rise is None else f"if it is {100 * rise:.0f} points more"


def _show_limit(sweep: Sweep) -> None:
    budget: Mapping[str, Any] | None = sweep["budget"]
    if sweep["state"] == "budget_exhausted" and budget is not None:
        left = {
            "--max-cost-usd": budget["remaining_cost_usd"],
            "--max-tokens": budget["remaining_tokens"],
            "--max-requests": budget["remaining_requests"],
        }
        # The remaining dollars and tokens may be too few for one request, but not 0.
        shares = {
            option: remaining / (budget[option[2:].replace("-", "_")] or 1)
            for option, remaining in left.items()
            if remaining is not None
        }
        option = min(shares, key=lambda name: shares[name])
        say(
            f"The budget is used up: `buildarena sweep budget {sweep['id']} {option} …` "
            "raises it, and the sweep continues."
        )


def _watch(client: Client, sweep_id: str, *, as_json: bool) -> Sweep:
    try:
        if as_json:
            sweep = client.wait_for_sweep(sweep_id)
            print_json(sweep)
            return sweep
        watched = watch_sweep(client, sweep_id)
    except KeyboardInterrupt:
        _stop_watching(client, sweep_id)
        raise
    _show_limit(watched)
    return watched


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
        client.post(at("sweeps", sweep_id, "pause"))
        warn(f"It is paused: `buildarena sweep resume {sweep_id}` continues it.")
