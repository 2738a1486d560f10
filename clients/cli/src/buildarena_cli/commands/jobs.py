"""The commands of jobs."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from buildarena_cli.client import Client, RefusedError
from buildarena_cli.errors import DONE, FAILED
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.output import console, number, print_json
from buildarena_cli.sweep_files import read_fields

app = typer.Typer(help="Submit and look at jobs.", no_args_is_help=True)

JobId = Annotated[str, typer.Argument(help="Id of the job.")]


@app.command("submit")
def submit_job(
    task: Annotated[str, typer.Argument(help="Task name.")],
    model: Annotated[str, typer.Argument(help="Model name.")],
    *,
    seed: Annotated[int, typer.Option(help="Seed or sample number.")] = 0,
    options: Annotated[
        Path | None, typer.Option(help="YAML file of further fields: simulator, limits, …")
    ] = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Submit one job; an equal one that exists is never done again."""
    body = {"task": task, "model": model, "seed": seed}
    if options is None:
        _show(Client(url).post("/v1/jobs", body), as_json=as_json)
        return
    more = read_fields(options).with_words(body)
    try:
        _show(Client(url).post("/v1/jobs", more.content), as_json=as_json)
    except RefusedError as error:
        raise more.refused(error) from error


@app.command("list")
def list_jobs(
    *,
    sweep: Annotated[str | None, typer.Option(help="Only this sweep's.")] = None,
    task: Annotated[str | None, typer.Option(help="Only this task's.")] = None,
    model: Annotated[str | None, typer.Option(help="Only this model's.")] = None,
    outcome: Annotated[
        str | None, typer.Option(help="Only this outcome; errored shows the dead letters.")
    ] = None,
    limit: Annotated[int, typer.Option(help="Rows at the most.", min=1, max=1000)] = 50,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """List jobs, newest first."""
    page = Client(url).get(
        "/v1/jobs", sweep=sweep, task=task, model=model, outcome=outcome, limit=limit
    )
    if as_json:
        print_json(page)
        return
    table = Table()
    for name in ("job", "task", "model", "seed", "state", "indicator"):
        table.add_column(name, overflow="fold")
    for job in page["jobs"]:
        state = job["outcome"] or f"{job['stage']} {job['state']}"
        reason = f" ({job['reason']})" if job["reason"] else ""
        table.add_row(
            job["id"],
            job["task"],
            job["model"],
            str(job["seed"]),
            state + reason,
            number(job["indicator"], 2),
        )
    console.print(table)


@app.command("show")
def show_job(job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Show a job: what it is, how it ended, what it used."""
    _show(Client(url).get(f"/v1/jobs/{job_id}"), as_json=as_json)


@app.command("logs")
def job_logs(job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Print a job's transcript as Markdown, or as JSON."""
    style = "json" if as_json else "markdown"
    data = Client(url).get_bytes(f"/v1/jobs/{job_id}/transcript?style={style}")
    console.file.write(data.decode() + "\n")


@app.command("cancel")
def cancel_job(job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """End a job that has not ended."""
    _show(Client(url).post(f"/v1/jobs/{job_id}/cancel", {}), as_json=as_json)


@app.command("retry")
def retry_job(job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Queue an errored job again where it failed; a scored job is never rolled again."""
    _show(Client(url).post(f"/v1/jobs/{job_id}/retry", {}), as_json=as_json)


@app.command("verify")
def verify_job(job_id: JobId, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
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
            kept, found = entry["kept"], entry["found"]
            shown = kept if entry["ok"] else f"kept {kept}, found {found}"
            console.print(f"{mark}  {entry['name']:<32} {shown}", soft_wrap=True)
        console.print("Every figure is the same." if report["ok"] else "Not the same.")
    raise typer.Exit(DONE if report["ok"] else FAILED)


def _show(job: dict[str, Any], *, as_json: bool) -> None:
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
    share = f" ({job['refused_actions'] / job['actions']:.1%})" if job["actions"] else ""
    console.print(f"actions   {job['actions']}, {job['refused_actions']} refused{share}")
    for attempt in job.get("attempts", ()):
        console.print(
            f"attempt   {attempt['token']} {attempt['stage']} on {attempt['worker']}: "
            f"{attempt['result'] or 'running'}",
            soft_wrap=True,
        )
