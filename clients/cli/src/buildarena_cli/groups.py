"""Groups of commands, as all of them look."""

from __future__ import annotations

import typer

CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 100}
"""Words that ask for help, and columns of its texts on wide terminals."""


def new_group(text: str, *, completed: bool = False) -> typer.Typer:
    """An empty group of commands.

    Args:
        text: What they are for.
        completed: Whether it has the options that install completion for a shell.
    """
    return typer.Typer(
        help=text,
        no_args_is_help=True,
        rich_markup_mode=None,
        add_completion=completed,
        pretty_exceptions_enable=False,
        context_settings=CONTEXT,
    )
