"""The commands of tasks: look at them, and add one's own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from buildarena_benchmark import Task, TaskError, ValidationIssue, parse_custom_task
from buildarena_cli.client import Client, RefusedError
from buildarena_cli.errors import FAILED, CommandError
from buildarena_cli.options import DEFAULT_URL, JsonOption, UrlOption
from buildarena_cli.output import console, error_console, in_words, print_json

app = typer.Typer(help="Look at tasks, and add your own.", no_args_is_help=True)

TaskFile = Annotated[Path, typer.Argument(help="YAML file of the task.")]


@app.command("list")
def list_tasks(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List the tasks; those that somebody added are marked."""
    found = Client(url).get("/v1/tasks")
    if as_json:
        print_json(found)
        return
    table = Table(caption="+ custom task, added by a user", caption_justify="left")
    for name in ("task", "title", "indicator", "version"):
        table.add_column(name, overflow="fold")
    for task in found:
        mark = "+" if task["custom"] else ""
        indicator = in_words(task["indicator"], task["unit"])
        table.add_row(task["name"] + mark, escape(task["title"]), indicator, task["version"])
    console.print(table)


@app.command("show")
def show_task(
    name: Annotated[str, typer.Argument(help="Task name.")],
    *,
    version: Annotated[
        str | None, typer.Option("--version", help="A version; default: the newest.")
    ] = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show what a model is told of a task; as JSON its whole document."""
    client = Client(url)
    try:
        task = client.get(f"/v1/tasks/{name}", version=version)
    except RefusedError as error:
        if error.status != NOT_FOUND or version is not None:
            raise
        names = ", ".join(known["name"] for known in client.get("/v1/tasks"))
        raise CommandError(f"{error}; choose from {names}") from error
    if as_json:
        print_json(task)
        return
    source = "added by a user" if task["custom"] else "built-in"
    console.print(f"{task['name']}, version {task['version']}, {source}\n", markup=False)
    console.print(task["statement"], markup=False)


@app.command("check")
def check_task(file: TaskFile, *, as_json: JsonOption = False) -> None:
    """Tell what is wrong with a task file, without any server."""
    try:
        task = _read(file)
    except TaskError as error:
        if not as_json:
            raise CommandError(str(error)) from error
        print_json({"ok": False, "errors": [_plain(issue) for issue in error.issues]})
        raise typer.Exit(FAILED) from error
    if as_json:
        print_json({"ok": True, "name": task.name, "version": task.version, "errors": []})
    else:
        console.print(f"{file}: {task.name}, version {task.version}", soft_wrap=True, markup=False)


@app.command("add")
def add_task(file: TaskFile, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Add a task, or a new version of one of yours; new submissions get it from then on."""
    try:
        before = _read(file)
        done = Client(url).upload("/v1/tasks", file, "application/yaml")
    except TaskError as error:
        raise CommandError(str(error)) from error
    except RefusedError as error:
        raise CommandError(_told(error.errors, file) or str(error)) from error
    if as_json:
        print_json(done)
        return
    console.print(f"{done['name']}, version {done['version']}")
    if not done["current"]:
        error_console.print(
            f"This version of {before.name} was there before; new submissions get a newer one. "
            "Change its statement, or name it otherwise, to have it used.",
            soft_wrap=True,
        )


NOT_FOUND = 404


def _read(file: Path) -> Task:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TaskError(
            [ValidationIssue(message=f"cannot be read: {error}")], origin=str(file)
        ) from error
    return parse_custom_task(text, origin=str(file))


def _told(errors: Sequence[dict[str, Any]], file: Path) -> str:
    return "\n".join(
        ValidationIssue(
            path=entry["field"],
            message=entry["message"],
            line=entry.get("line"),
            choices=tuple(entry["choices"]),
        ).describe(str(file))
        for entry in errors
    )


def _plain(issue: ValidationIssue) -> dict[str, Any]:
    return issue.model_dump(mode="json", by_alias=True)
