"""The command ``buildarena``."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from buildarena_cli import service
from buildarena_cli.client import Client
from buildarena_cli.doctor import examine
from buildarena_cli.errors import DONE, FAILED, CommandError
from buildarena_cli.output import console, error_console, leaderboard_tables, number, print_json
from buildarena_cli.progress import exit_code, watch_sweep
from buildarena_pipeline.settings import DEFAULT_PORT

app = typer.Typer(
    help="Find out whether language models can engineer.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
sweep_app = typer.Typer(help="Submit and watch sweeps.", no_args_is_help=True)
job_app = typer.Typer(help="Look at jobs.", no_args_is_help=True)
app.add_typer(sweep_app, name="sweep")
app.add_typer(job_app, name="job")

UrlOption = Annotated[str, typer.Option("--url", envvar="BUILDARENA_URL", help="Where the API is.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for programs.")]
DEFAULT_URL = f"http://127.0.0.1:{DEFAULT_PORT}"

app.command()(service.up)
app.command()(service.demo)
app.command()(service.migrate)


@app.command()
def doctor(url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Tell what is wrong with the service and what to do; exit code 1 when anything is."""
    if not examine(Client(url), as_json=as_json):
        raise typer.Exit(FAILED)


@app.command()
def mcp(
    url: UrlOption = DEFAULT_URL,
    http: Annotated[
        int | None, typer.Option("--http", help="Serve streamable HTTP on this loopback port.")
    ] = None,
) -> None:
    """Let agents that speak the Model Context Protocol build and be scored."""
    import asyncio

    from buildarena_cli.mcp_server import make_server, serve_stdio

    if http is None:
        asyncio.run(serve_stdio(Client(url)))
        return
    import uvicorn

    server = make_server(Client(url)).streamable_http_app()
    uvicorn.run(server, host="127.0.0.1", port=http, log_level="warning")


@app.command()
def leaderboard(
    task: Annotated[str | None, typer.Option(help="Only this task.")] = None,
    track: Annotated[str | None, typer.Option(help="Track; default: the first.")] = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show who builds best on one track."""
    board = Client(url).get("/v1/leaderboard", task=task, track=track)
    if as_json:
        print_json(board)
        return
    if not board["tasks"]:
        console.print("No jobs have ended yet.")
        return
    console.print(f"Track {board['track']}", soft_wrap=True)
    for table in leaderboard_tables(board):
        console.print(table)


@sweep_app.command("run")
def sweep_run(
    file: Annotated[Path, typer.Argument(help="YAML file of the sweep.")],
    detach: Annotated[bool, typer.Option(help="Submit and do not wait.")] = False,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Submit a sweep and watch it. Running the same file again does only what is missing."""
    client = Client(url)
    accepted = client.post("/v1/sweeps", _read_yaml(file))
    if not as_json:
        console.print(f"{accepted['id']}: {accepted['jobs']} jobs, {accepted['added']} of them new")
    if detach:
        if as_json:
            print_json(accepted)
        return
    sweep = _watch(client, accepted["id"], as_json=as_json)
    raise typer.Exit(exit_code(sweep))


@sweep_app.command("status")
def sweep_status(
    sweep_id: Annotated[str, typer.Argument(help="Id of the sweep.")],
    watch: Annotated[bool, typer.Option(help="Wait until every job has ended.")] = False,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show how far a sweep is."""
    client = Client(url)
    if watch:
        raise typer.Exit(exit_code(_watch(client, sweep_id, as_json=as_json)))
    sweep = client.get(f"/v1/sweeps/{sweep_id}")
    if as_json:
        print_json(sweep)
        return
    progress = sweep["progress"]
    console.print(f"{sweep['id']} {sweep['name']!r}: {sweep['state']}")
    console.print(f"{progress['done']} of {progress['total']} jobs ended")
    for name, count in {**progress["stages"], **progress["outcomes"]}.items():
        console.print(f"  {count:>6}  {name}")
    console.print(f"{progress['requests']:,} model requests, ${progress['cost_usd']:.2f}")


@job_app.command("show")
def job_show(
    job_id: Annotated[str, typer.Argument(help="Id of the job.")],
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show a job: what it is, how it ended, what it used."""
    job = Client(url).get(f"/v1/jobs/{job_id}")
    if as_json:
        print_json(job)
        return
    console.print(f"{job['id']}  {job['task']} x {job['model']} x seed {job['seed']}")
    console.print(f"track     {job['track']}", soft_wrap=True)
    ended = job["outcome"] or f"{job['stage']} {job['state']}"
    console.print(f"outcome   {ended}" + (f" ({job['reason']})" if job["reason"] else ""))
    if job["detail"]:
        console.print(f"detail    {job['detail']}", soft_wrap=True)
    console.print(f"indicator {number(job['indicator'], 3)}")
    usage = job["usage"]
    console.print(
        f"usage     {usage['requests']} requests, {usage['input_tokens']:,} tokens in, "
        f"{usage['output_tokens']:,} out, ${usage['cost_usd']:.4f}"
    )
    console.print(f"actions   {job['actions']}, {job['refused_actions']} refused")
    for attempt in job["attempts"]:
        console.print(
            f"attempt   {attempt['token']} {attempt['stage']} on {attempt['worker']}: "
            f"{attempt['result'] or 'running'}",
            soft_wrap=True,
        )


@job_app.command("verify")
def job_verify(
    job_id: Annotated[str, typer.Argument(help="Id of the job.")],
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Replay a finished job without a model, simulate it again and compare every figure."""
    client = Client(url)
    check = client.post(f"/v1/jobs/{job_id}/verify", {})
    while check["state"] != "done":
        time.sleep(0.3)
        check = client.get_patiently(f"/v1/verifications/{check['id']}")
    report = check["report"]
    if as_json:
        print_json(report)
    else:
        for entry in report["checks"]:
            mark = "ok" if entry["ok"] else "!!"
            shown = (
                entry["kept"] if entry["ok"] else f"kept {entry['kept']}, found {entry['found']}"
            )
            console.print(f"{mark}  {entry['name']:<32} {shown}", soft_wrap=True)
        console.print("Every figure is the same." if report["ok"] else "Not the same.")
    raise typer.Exit(DONE if report["ok"] else FAILED)


def _watch(client: Client, sweep_id: str, *, as_json: bool) -> dict[str, Any]:
    if not as_json:
        return watch_sweep(client, sweep_id)
    while True:
        sweep: dict[str, Any] = client.get_patiently(f"/v1/sweeps/{sweep_id}")
        if sweep["progress"]["done"] == sweep["progress"]["total"]:
            print_json(sweep)
            return sweep
        time.sleep(0.5)


def _read_yaml(file: Path) -> dict[str, Any]:
    try:
        document = yaml.safe_load(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise CommandError(f"{file}: {error.strerror}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise CommandError(f"{file} is no YAML: {error}") from error
    if not isinstance(document, dict):
        raise CommandError(f"{file} must hold a mapping with tasks, models and seeds")
    return document


def run() -> None:
    """Runs the command line and exits with its code."""
    try:
        app()
    except CommandError as error:
        error_console.print(str(error), soft_wrap=True)
        sys.exit(error.code)
