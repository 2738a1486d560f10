"""The commands of tasks: show them, and add custom ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from buildarena_cli.client import Client, RefusedError, at
from buildarena_cli.errors import FAILED, CommandError, did_you_mean, suggest_field
from buildarena_cli.options import DEFAULT_URL, JsonOption, TaskName, UrlOption, new_group, to_read
from buildarena_cli.terminal.output import in_words, print_json, print_table, say, warn

if TYPE_CHECKING:
    from buildarena_benchmark import Task, ValidationIssue

app = new_group("Look at tasks, and add your own.")

TaskFile = Annotated[Path, typer.Argument(help="YAML file of the task.", callback=to_read)]


@app.command("list")
def list_tasks(*, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """List the tasks; custom ones are marked."""
    tasks = Client(url).tasks()
    if as_json:
        print_json(tasks)
        return
    print_table(
        ("task", "title", "indicator", "version"),
        [
            (
                task["name"] + ("+" if task["custom"] else ""),
                task["title"],
                in_words(task["indicator"], task["unit"]),
                task["version"],
            )
            for task in tasks
        ],
        notes=["+ custom task, added by a user"] if any(t["custom"] for t in tasks) else [],
    )


@app.command("show")
def show_task(
    name: TaskName,
    *,
    version: Annotated[
        str | None, typer.Option("--version", help="A version; default: the newest.")
    ] = None,
    url: UrlOption = DEFAULT_URL,
    as_json: JsonOption = False,
) -> None:
    """Show a task's statement as models read it; with --json, the complete document."""
    client = Client(url)
    try:
        task = client.get(at("tasks", name), version=version)
    except RefusedError as error:
        if error.status != NOT_FOUND or version is not None:
            raise
        names = [entry["name"] for entry in client.tasks()]
        raise CommandError(
            f"{error}; valid tasks: {', '.join(names)}{did_you_mean(name, names)}"
        ) from error
    if as_json:
        print_json(task)
        return
    source = "added by a user" if task["custom"] else "built-in"
    ceiling = "" if task.get("ceiling") is None else f", at most {task['ceiling']:,g}"
    ranked = f"ranked by {in_words(task['indicator'], task['unit'])}{ceiling}"
    say(f"{task['name']}, version {task['version']}, {source}, {ranked}\n")
    say(task["statement"])


@app.command("check")
def check_task(file: TaskFile, *, as_json: JsonOption = False) -> None:
    """Check a task file, without any server."""
    from buildarena_benchmark import TaskError

    try:
        task = _read(file)
    except TaskError as error:
        if not as_json:
            raise _refusal(error.issues, file) from error
        print_json({"ok": False, "errors": [_plain(issue) for issue in error.issues]})
        raise typer.Exit(FAILED) from error
    if as_json:
        print_json({"ok": True, "name": task.name, "version": task.version, "errors": []})
    else:
        say(f"{file}: {task.name}, version {task.version}")


@app.command("add")
def add_task(file: TaskFile, *, url: UrlOption = DEFAULT_URL, as_json: JsonOption = False) -> None:
    """Add a task, or a new version of one of yours, which new submissions use."""
    from buildarena_benchmark import TaskError

    try:
        before = _read(file)
        done = Client(url).upload("/v1/tasks", file, "application/yaml")
    except TaskError as error:
        raise _refusal(error.issues, file) from error
    except RefusedError as error:
        if not error.errors:
            raise
        raise _refusal(_issues(error.errors), file) from error
    if as_json:
        print_json(done)
        return
    say(f"{done['name']}, version {done['version']}")
    if not done["current"]:
        warn(
            f"This version of {before.name} already exists; new submissions get a newer one. "
            "To use this text, change its statement or its name."
        )


NOT_FOUND = 404


def _read(file: Path) -> Task:
    from buildarena_benchmark import TaskError, ValidationIssue, parse_custom_task

    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TaskError(
            [ValidationIssue(message=f"cannot be read: {error}")], origin=str(file)
        ) from error
    return parse_custom_task(text, origin=str(file))


def _issues(errors: Sequence[dict[str, Any]]) -> list[ValidationIssue]:
    from buildarena_benchmark import ValidationIssue

    return [
        ValidationIssue(
            path=entry["field"],
            message=entry["message"],
            line=entry.get("line"),
            choices=tuple(entry["choices"]),
        )
        for entry in errors
    ]


def _refusal(issues: Sequence[ValidationIssue], file: Path) -> CommandError:
    return CommandError(
        "\n".join(
            issue.describe(str(file)) + suggest_field(issue.path, issue.message, issue.choices)
            for issue in issues
        )
    )


def _plain(issue: ValidationIssue) -> dict[str, Any]:
    return issue.model_dump(mode="json", by_alias=True)
