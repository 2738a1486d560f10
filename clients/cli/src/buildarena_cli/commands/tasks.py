"""The commands of tasks: show them, and add custom ones."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from buildarena_cli.errors import FAILED, CommandError, did_you_mean, refusal
from buildarena_cli.options import (
    JsonOption,
    ServiceOption,
    TaskName,
    new_group,
    printed_by,
    to_read,
)
from buildarena_cli.terminal.output import in_words, print_json, print_line, print_rows, warn
from buildarena_client.errors import NotFoundError, RefusedError

app = new_group("Look at tasks, and add your own.")
TaskFile = Annotated[Path, typer.Argument(help="YAML file of the task.", callback=to_read)]
COLUMNS = {
    "task": lambda task: task["name"] + ("+" if task["custom"] else ""),
    "title": lambda task: task["title"],
    "indicator": lambda task: in_words(task["indicator"], task["unit"]),
    "version": lambda task: task["version"],
}
NOTES = ["+ custom task, added by a user"]


@app.command("list")
@printed_by(lambda tasks: print_rows(COLUMNS, tasks, notes=NOTES))
def list_tasks(*, client: ServiceOption) -> Any:
    """List the tasks; custom ones are marked."""
    return client.tasks()


def _show(task: dict[str, Any]) -> None:
    source = "added by a user" if task["custom"] else "built-in"
    ceiling = "" if task.get("ceiling") is None else f", at most {task['ceiling']:,g}"
    ranked = f"ranked by {in_words(task['indicator'], task['unit'])}{ceiling}"
    print_line(f"{task['name']}, version {task['version']}, {source}, {ranked}\n")
    print_line(task["statement"])


@app.command("show")
@printed_by(_show)
def show_task(
    name: TaskName,
    *,
    version: Annotated[str | None, typer.Option(help="A version; default: the newest.")] = None,
    client: ServiceOption,
) -> Any:
    """Show a task's statement as models read it; with --json, the complete document."""
    try:
        return client.task(name, version=version)
    except NotFoundError as error:
        if version is not None:
            raise
        names = [entry["name"] for entry in client.tasks()]
        raise CommandError(
            f"{error}; valid tasks: {', '.join(names)}{did_you_mean(name, names)}"
        ) from error


@app.command("check")
def check_task(file: TaskFile, *, as_json: JsonOption = False) -> None:
    """Check a task file, without any server."""
    from buildarena_benchmark import TaskError, ValidationIssue, parse_custom_task

    try:
        task = parse_custom_task(file.read_text(encoding="utf-8"), origin=str(file))
    except (TaskError, OSError, UnicodeDecodeError) as error:
        unreadable = [ValidationIssue(message=f"cannot be read: {error}")]
        issues = error.issues if isinstance(error, TaskError) else unreadable
        if not as_json:
            raise refusal(issues, str(file)) from error
        errors = [issue.model_dump(mode="json", by_alias=True) for issue in issues]
        print_json({"ok": False, "errors": errors})
        raise typer.Exit(FAILED) from error
    if as_json:
        print_json({"ok": True, "name": task.name, "version": task.version, "errors": []})
    else:
        print_line(f"{file}: {task.name}, version {task.version}")


def _show_added(task: dict[str, Any]) -> None:
    print_line(f"{task['name']}, version {task['version']}")
    if not task["current"]:
        warn(
            "This version already exists; new submissions get a newer one. To use this text, "
            "change its statement or its name."
        )


@app.command("add")
@printed_by(_show_added)
def add_task(file: TaskFile, *, client: ServiceOption) -> Any:
    """Add a task, or a new version of one of yours, which new submissions use."""
    from buildarena_benchmark import ValidationIssue

    try:
        return client.add_task(file)
    except RefusedError as error:
        if not error.errors:
            raise
        raise refusal(map(ValidationIssue.model_validate, error.errors), str(file)) from error
    except OSError as error:
        raise CommandError(f"{file}: {error.strerror}") from error
