"""The command ``buildarena``."""

from __future__ import annotations

import os
import sys

import typer

from buildarena_cli.errors import CommandError
from buildarena_cli.lazy import CONTEXT, LazyGroup
from buildarena_cli.terminal.output import is_terminal, warn

UNWRAPPED = 10_000
"""Columns of help texts that go to no terminal: a sentence stays one line."""

COMPLETING = "_BUILDARENA_COMPLETE"
"""The variable with which the shell's completion script calls."""

app = typer.Typer(
    cls=LazyGroup,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings=CONTEXT,
)


@app.callback()
def _buildarena() -> None:
    """Find out whether language models can engineer."""


def run() -> None:
    """Runs the command line and exits with its code."""
    if COMPLETING in os.environ:
        _complete_without_rich()
    try:
        app(**({} if is_terminal() else {"terminal_width": UNWRAPPED, "max_content_width": None}))
    except CommandError as error:
        warn(str(error))
        sys.exit(error.code)


def _complete_without_rich() -> None:
    # For zsh and fish, typer takes markup out of each help text by loading Rich, which doubles the
    # time of a completion. Our texts have no markup; without this, completion is only slower.
    import typer._completion_classes as classes

    vars(classes)["_sanitize_help_text"] = str
