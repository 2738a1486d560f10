"""`buildarena job list`: jobs by what they are and how they ended."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from buildarena_cli.client import Client
from buildarena_cli.ids import resolve_id
from buildarena_cli.options import DEFAULT_URL, AfterOption, AllOption, JsonOption, UrlOption
from buildarena_cli.terminal.output import minute_of, number, print_json, print_table, warn

MAX_LIMIT = 200
COLUMNS = ("job", "task", "model", "seed", "state", "reason", "flags", "indicator", "created")


def list_jobs(
    *,
    sweep: Annotated[list[str] | None, typer.Option(help="Only jobs of these sweeps.")] = None,
    task: Annotated[list[str] | None, typer.Option(help="Only jobs of these tasks.")] = None,
    model: Annotated[list[str] | None, typer.Option(help="Only jobs of these models.")] = None,
    state: Annotated[list[str] | None, typer.Option(help="Only in these states.")] = None,
    outcome: Annotated[
        list[str] | None, typer.Option(help="Only these outcomes; errored shows the dead letters.")
    ] = None,
    reason: Annotated[list[str] | None, typer.Option(help="Only these reasons of failure.")] = None,
    flag: Annotated[list[str] | None, typer.Option(help="Only with one of these flags.")] = None,
    limit: Annotated[int, typer.Option(help="Rows at most.", min=1, max=MAX_LIMIT)] = 50,
    after: AfterOption = None,
    every: AllOption = False,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """List jobs, newest first."""
    client = Client(url)
    pages = client.pages(
        "/v1/jobs",
        cursor=after,
        sweep=[resolve_id(client, "sweep", word) for word in sweep or ()] or None,
        task=task,
        model=model,
        state=state,
        outcome=outcome,
        reason=reason,
        flag=flag,
        limit=MAX_LIMIT if every else limit,
    )
    page = gathered(pages, every=every)
    if as_json:
        print_json(page)
        return
    print_table(COLUMNS, [_row(job) for job in page["data"]], numeric=("seed", "indicator"))
    show_cursor(page)


def gathered(pages: Any, *, every: bool) -> dict[str, Any]:
    """Return one page of a list, or all pages as one."""
    if not every:
        first: dict[str, Any] = next(pages)
        return first
    return {"data": [entry for page in pages for entry in page["data"]], "next_cursor": None}


def show_cursor(page: dict[str, Any]) -> None:
    """Name the next page, if there is one, where a pipe does not take it for a row."""
    if page["next_cursor"] is not None:
        warn(f"more: --after {page['next_cursor']}, or --all")


def _row(job: dict[str, Any]) -> list[str]:
    return [
        job["id"],
        job["task"],
        job["model"],
        str(job["seed"]),
        job["outcome"] or f"{job['stage']} {job['state']}",
        job["reason"] or "",
        ", ".join(job["flags"]),
        number(job["indicator"], 2, at_least=job["censored"]),
        minute_of(job["created_at"]),
    ]
