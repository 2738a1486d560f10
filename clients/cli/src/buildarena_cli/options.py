"""Shared options and arguments of commands, and groups of commands."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup

from buildarena_cli.defaults import DEFAULT_URL
from buildarena_cli.errors import USAGE, CommandError

CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 100}
"""Words that ask for help, and columns of its texts on wide terminals."""


def new_group(
    text: str, *, completed: bool = False, kind: type[TyperGroup] | None = None
) -> typer.Typer:
    """Return an empty group of commands.

    Args:
        text: Help text of the group.
        completed: Whether the group has the options to install shell completion.
        kind: Class of the group; typer's own by default.
    """
    return typer.Typer(
        help=text,
        cls=kind,
        no_args_is_help=True,
        rich_markup_mode=None,
        add_completion=completed,
        pretty_exceptions_enable=False,
        context_settings=CONTEXT,
    )


STANDARD_INPUT: Final = "-"


def to_read(path: Path | None) -> Path | None:
    """Return an input path after checking that it exists; None for an omitted option.

    Raises:
        CommandError: The path does not exist; a usage error.
    """
    if path is not None and str(path) != STANDARD_INPUT and not path.exists():
        raise CommandError(f"{path}: No such file or directory", USAGE)
    return path


def to_read_or_url(place: str) -> str:
    """Return a path after checking that it exists, or the URL of a store.

    Raises:
        CommandError: The path does not exist; a usage error.
    """
    if "://" not in place:
        to_read(Path(place))
    return place


def to_read_or_name(name: str) -> str:
    """Return a name, or the path of a YAML file after checking that it exists.

    Raises:
        CommandError: It looks like a path and nothing is there; a usage error.
    """
    if name.endswith((".yaml", ".yml")) or os.sep in name:
        to_read(Path(name))
    return name


__all__ = ["DEFAULT_URL"]

UrlOption = Annotated[str, typer.Option("--url", envvar="BUILDARENA_URL", help="Where the API is.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for programs.")]
DataOption = Annotated[Path | None, typer.Option("--data", help="Folder of databases and logs.")]
PortOption = Annotated[int | None, typer.Option("--port", help="Port of the API.")]
MaxCostOption = Annotated[
    float | None, typer.Option("--max-cost-usd", help="Budget in US dollars.", min=0)
]
MaxTokensOption = Annotated[
    int | None, typer.Option("--max-tokens", help="Budget in tokens, in and out.", min=1)
]
MaxRequestsOption = Annotated[
    int | None, typer.Option("--max-requests", help="Budget in model requests.", min=1)
]

JobId = Annotated[str, typer.Argument(help="Id of the job, or its beginning.")]
SweepId = Annotated[str, typer.Argument(help="Id of the sweep, or its beginning.")]
KeyId = Annotated[str, typer.Argument(help="Id of the key, or its beginning.")]
TaskName = Annotated[str, typer.Argument(help="Task name.")]
ModelName = Annotated[str, typer.Argument(help="Model name.")]
TasksOption = Annotated[list[str] | None, typer.Option("--task", help="Only these tasks.")]
ModelsOption = Annotated[list[str] | None, typer.Option("--model", help="Only these models.")]
TrackOption = Annotated[
    str | None,
    typer.Option(
        "--track",
        help="Track; default: the standard one if jobs of it have ended, otherwise the one with "
        "the most ended jobs.",
    ),
]
AfterOption = Annotated[str | None, typer.Option("--after", help="Cursor of the previous page.")]
AllOption = Annotated[bool, typer.Option("--all", help="Every page.")]


def budget_of(
    max_cost_usd: float | None, max_tokens: int | None, max_requests: int | None
) -> dict[str, Any] | None:
    """Return the budget of the options; None without any."""
    limits = {
        "max_cost_usd": max_cost_usd,
        "max_tokens": max_tokens,
        "max_requests": max_requests,
    }
    return {name: value for name, value in limits.items() if value is not None} or None
