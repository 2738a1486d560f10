"""`buildarena job list`: jobs by what they are and how they ended."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from buildarena_cli.ids import resolve_id
from buildarena_cli.options import (
    AllOption,
    LimitOption,
    ModelsOption,
    ServiceOption,
    SweepsOption,
    TasksOption,
    printed_by,
)
from buildarena_cli.terminal.output import minute_of, number, print_rows, warn
from buildarena_client.client import Client

COLUMNS = {
    "job": lambda job: job["id"],
    "task": lambda job: job["task"],
    "model": lambda job: job["model"],
    "seed": lambda job: str(job["seed"]),
    "state": lambda job: job["outcome"] or f"{job['stage']} {job['state']}",
    "reason": lambda job: job["reason"] or "",
    "flags": lambda job: ", ".join(job["flags"]),
    "indicator": lambda job: number(job["indicator"], 2, at_least=job["censored"]),
    "created": lambda job: minute_of(job["created_at"]),
}


def show_page(columns: Any, page: dict[str, Any]) -> None:
    """Print a page of a list, and where a pipe does not take it for a row, that there are more."""
    print_rows(columns, page["data"])
    if page["next_cursor"] is not None:
        warn(f"these are the newest {len(page['data'])}; all: --all, more: --limit")


def listed(client: Client, path: str, limit: int, *, every: bool, **filters: Any) -> dict[str, Any]:
    """Return the first page of a list, or all pages as one."""
    if every:
        return {"data": client.every(path, **filters), "next_cursor": None}
    page: dict[str, Any] = client.get(path, limit=limit, **filters)
    return page


@printed_by(lambda page: show_page(COLUMNS, page))
def list_jobs(
    *,
    sweep: SweepsOption = None,
    task: TasksOption = None,
    model: ModelsOption = None,
    state: Annotated[list[str] | None, typer.Option(help="Only in these states.")] = None,
    outcome: Annotated[
        list[str] | None, typer.Option(help="Only these outcomes; errored shows the dead letters.")
    ] = None,
    reason: Annotated[list[str] | None, typer.Option(help="Only these reasons of failure.")] = None,
    flag: Annotated[list[str] | None, typer.Option(help="Only with one of these flags.")] = None,
    limit: LimitOption = 50,
    every: AllOption = False,
    client: ServiceOption,
) -> Any:
    """List jobs, newest first."""
    return listed(
        client,
        "/v1/jobs",
        limit,
        every=every,
        sweep=[resolve_id(client, "sweep", word) for word in sweep or ()] or None,
        task=task,
        model=model,
        state=state,
        outcome=outcome,
        reason=reason,
        flag=flag,
    )
