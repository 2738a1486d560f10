"""The commands of sweeps."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from buildarena_cli.client import Client, RefusedError
from buildarena_cli.commands.keys import spent
from buildarena_cli.errors import CommandError
from buildarena_cli.options import (
    DEFAULT_URL,
    JsonOption,
    MaxCostOption,
    MaxRequestsOption,
    MaxTokensOption,
    UrlOption,
    budget_of,
)
from buildarena_cli.output import console, number, print_json
from buildarena_cli.progress import ended, exit_code, watch_sweep
from buildarena_cli.sweep_files import read_sweep, sweep_schema

app = typer.Typer(help="Submit and watch sweeps.", no_args_is_help=True)

SweepId = Annotated[str, typer.Argument(help="Id of the sweep.")]


@app.command("run")
def run_sweep(
    file: Annotated[Path, typer.Argument(help="YAML file of the sweep.")],
    *,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show what it would be and cost; submit nothing.")
    ] = False,
    detach: Annotated[bool, typer.Option("--detach", help="Submit and do not wait.")] = False,
    task: Annotated[
        list[str] | None, typer.Option("--task", help="In the place of the file's tasks.")
    ] = None,
    model: Annotated[
        list[str] | None, typer.Option("--model", help="In the place of the file's models.")
    ] = None,
    samples: Annotated[
        int | None, typer.Option("--samples", help="In the place of the file's samples or seeds.")
    ] = None,
    seed: Annotated[
        list[int] | None,
        typer.Option("--seed", help="In the place of the file's seeds or samples."),
    ] = None,
    max_cost_usd: MaxCostOption = None,
    max_tokens: MaxTokensOption = None,
    max_requests: MaxRequestsOption = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Submit a sweep and watch it. Running the same file again takes it up where it was."""
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
            _show_estimate(client.post("/v1/sweeps/estimate", sweep.content), as_json=as_json)
            return
        accepted = client.post("/v1/sweeps?resume=true", sweep.content)
    except RefusedError as error:
        raise sweep.refused(error) from error
    if not as_json:
        news = "resumed" if accepted["resumed"] else f"{accepted['added']} of them new"
        console.print(f"{accepted['id']}: {accepted['jobs']} jobs, {news}")
    if detach:
        if as_json:
            print_json(accepted)
        return
    raise typer.Exit(exit_code(_watch(client, accepted["id"], as_json=as_json)))


@app.command("schema")
def print_schema() -> None:
    """Print the JSON schema of sweep files, for editors; docs/sweep.schema.json holds it."""
    print_json(sweep_schema())


@app.command("status")
def show_sweep(
    sweep_id: SweepId,
    *,
    watch: Annotated[bool, typer.Option("--watch", help="Wait until every job has ended.")] = False,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show how far a sweep is."""
    client = Client(url)
    if watch:
        raise typer.Exit(exit_code(_watch(client, sweep_id, as_json=as_json)))
    _show(client.get(f"/v1/sweeps/{sweep_id}"), as_json=as_json)


@app.command("pause")
def pause_sweep(
    sweep_id: SweepId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Hold a sweep's waiting jobs; jobs that have begun go on to their end."""
    _show(Client(url).post(f"/v1/sweeps/{sweep_id}/pause", {}), as_json=as_json)


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
    """Let a sweep go on that was paused, or that used up its budget and now gets more."""
    budget = budget_of(max_cost_usd, max_tokens, max_requests)
    body = {"budget": budget}
    _show(Client(url).post(f"/v1/sweeps/{sweep_id}/resume", body), as_json=as_json)


@app.command("retry")
def retry_sweep(
    sweep_id: SweepId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """Queue a sweep's errored jobs again where they failed; scored ones are never redone."""
    _show(Client(url).post(f"/v1/sweeps/{sweep_id}/retry", {}), as_json=as_json)


@app.command("cancel")
def cancel_sweep(
    sweep_id: SweepId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False
) -> None:
    """End a sweep's jobs that have not ended and that no other sweep wants."""
    _show(Client(url).post(f"/v1/sweeps/{sweep_id}/cancel", {}), as_json=as_json)


@app.command("export")
def export_sweep(
    sweep_id: SweepId,
    *,
    out: Annotated[Path | None, typer.Option(help="File to write; SWEEP.zip without.")] = None,
    url: UrlOption = DEFAULT_URL,
) -> None:
    """Write a whole sweep, artifacts included, into one ZIP file."""
    target = out or Path(f"{sweep_id}.zip")
    try:
        Client(url).download(f"/v1/sweeps/{sweep_id}/archive", target)
    except OSError as error:
        raise CommandError(f"{target}: {error.strerror}") from error
    console.print(f"{target}: {target.stat().st_size:,} bytes")


@app.command("import")
def import_sweep(
    file: Annotated[Path, typer.Argument(help="ZIP file that `sweep export` wrote.")],
    *,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Take an exported sweep in; jobs that are there already stay as they are."""
    try:
        done = Client(url).upload("/v1/archives", file, "application/zip")
    except OSError as error:
        raise CommandError(f"{file}: {error.strerror}") from error
    if as_json:
        print_json(done)
    else:
        console.print(f"{done['sweep_id']}: {done['jobs']} jobs, {done['added']} of them new")


def _show(sweep: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print_json(sweep)
        return
    progress = sweep["progress"]
    console.print(f"{sweep['id']} {sweep['name']!r}: {sweep['state']}")
    console.print(f"{progress['done']} of {progress['total']} jobs ended")
    for name, count in {**progress["stages"], **progress["outcomes"]}.items():
        console.print(f"  {count:>6}  {name}")
    console.print(f"{progress['requests']:,} model requests, ${progress['cost_usd']:.2f}")
    if sweep["budget"] is not None:
        console.print(f"budget: {spent(sweep['budget'])}")
    _tell_of_limit(sweep)


def _show_estimate(estimate: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print_json(estimate)
        return
    table = Table(
        title=f"{estimate['jobs']:,} jobs, about ${estimate['cost_usd']:,.2f}",
        caption="From the mean figures that the paper reports; models without a known price: -",
        title_justify="left",
        caption_justify="left",
    )
    table.add_column("model")
    for name in ("jobs", "requests", "tokens in", "tokens out", "USD"):
        table.add_column(name, justify="right")
    for model in estimate["models"]:
        table.add_row(
            model["model"],
            f"{model['jobs']:,}",
            number(model["requests"], 0),
            number(model["input_tokens"], 0),
            number(model["output_tokens"], 0),
            number(model["cost_usd"], 2),
        )
    console.print(table)


def _tell_of_limit(sweep: dict[str, Any]) -> None:
    if sweep["state"] == "budget_exhausted":
        console.print(
            f"The budget is used up: `buildarena sweep resume {sweep['id']} --max-cost-usd …` "
            "gives it more.",
            soft_wrap=True,
        )


def _watch(client: Client, sweep_id: str, *, as_json: bool) -> dict[str, Any]:
    if not as_json:
        watched = watch_sweep(client, sweep_id)
        _tell_of_limit(watched)
        return watched
    while True:
        sweep: dict[str, Any] = client.get_patiently(f"/v1/sweeps/{sweep_id}")
        if ended(sweep):
            print_json(sweep)
            return sweep
        time.sleep(0.5)
