"""Shared options and arguments of commands, and groups of commands."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

import typer
from typer.core import TyperGroup

from buildarena_cli.errors import DONE, USAGE, CommandError
from buildarena_cli.terminal.output import print_json
from buildarena_client.client import Client
from buildarena_client.config import DEFAULT_URL, URL_VARIABLE
from buildarena_client.errors import BadArgumentError

if TYPE_CHECKING:
    from buildarena_backend.settings import Settings

CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 100}
"""Words that ask for help, and columns of its texts on wide terminals."""


PASSED_ON: Final = {"allow_extra_args": True, "ignore_unknown_options": True}
"""Settings of commands whose further words go to another program."""


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


InputPath = TypeVar("InputPath", Path, Path | None)


def to_read(path: InputPath) -> InputPath:
    """Return an input path after checking that it exists; None for an omitted option.

    Raises:
        CommandError: The path does not exist; a usage error.
    """
    if path is not None and str(path) != STANDARD_INPUT and not path.exists():
        raise CommandError(f"{path}: No such file or directory", USAGE)
    return path


def settings_with(**options: Any) -> Settings:
    """Return the settings of this process with values of options instead; None of omitted ones.

    Raises:
        CommandError: They are invalid.
    """
    from buildarena_backend.errors import StartupError
    from buildarena_backend.settings import load_settings

    try:
        return load_settings(**{k: value for k, value in options.items() if value is not None})
    except StartupError as error:
        raise CommandError(str(error)) from error


def service_at(url: str) -> Client:
    """Return a client of the service at an address.

    Raises:
        CommandError: The address or the key is invalid.
    """
    try:
        return Client(url)
    except BadArgumentError as error:
        raise CommandError(str(error)) from error


ServiceOption = Annotated[
    Client,
    typer.Option(
        "--url",
        envvar=URL_VARIABLE,
        help=f"Where the API is; default: {DEFAULT_URL}.",
        metavar="TEXT",
        parser=service_at,
        default_factory=lambda: DEFAULT_URL,
        show_default=False,
    ),
]
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
SweepsOption = Annotated[
    list[str] | None, typer.Option("--sweep", help="Only jobs of these sweeps.")
]
LimitOption = Annotated[int, typer.Option("--limit", help="Rows at most.", min=1, max=200)]
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


def printed_by(
    show: Callable[[Any], object], *, code: Callable[[Any], int] = lambda _: DONE
) -> Callable[[Callable[..., Any]], Callable[..., None]]:
    """Return a decorator of commands that prints what they return.

    Args:
        show: Prints it for people; --json, which commands get by this, prints it as it is.
        code: Returns the exit code.
    """

    def decorate(command: Callable[..., Any]) -> Callable[..., None]:
        @functools.wraps(command)
        def run(*, as_json: bool, **options: Any) -> None:
            answer = command(**options)
            (print_json if as_json else show)(answer)
            if code(answer):
                raise typer.Exit(code(answer))

        kind = inspect.Parameter.KEYWORD_ONLY
        option = inspect.Parameter("as_json", kind, default=False, annotation=JsonOption)
        signature = inspect.signature(command, eval_str=True)
        parameters = [*signature.parameters.values(), option]
        run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        return run

    return decorate
