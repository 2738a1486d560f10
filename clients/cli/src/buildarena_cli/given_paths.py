"""Files that commands are given to read: they are looked for before anything else is done."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from buildarena_cli.errors import USAGE, CommandError

STANDARD_INPUT: Final = "-"


def to_read(path: Path | None) -> Path | None:
    """A path that is there, for the options and arguments that name what a command reads.

    Args:
        path: What was given; None where an option was left out.

    Raises:
        CommandError: There is neither a file nor a folder; a usage error.
    """
    if path is not None and str(path) != STANDARD_INPUT and not path.exists():
        raise CommandError(f"{path}: No such file or directory", USAGE)
    return path


def to_read_or_url(place: str) -> str:
    """The same for what is a path, or the URL of a store.

    Raises:
        CommandError: It is no URL, and nothing is there; a usage error.
    """
    if "://" not in place:
        to_read(Path(place))
    return place


def to_read_or_name(name: str) -> str:
    """The same for what is a name, or the path of a YAML file.

    Raises:
        CommandError: It looks like a path and nothing is there; a usage error.
    """
    if name.endswith((".yaml", ".yml")) or os.sep in name:
        to_read(Path(name))
    return name
