"""Default addresses and files of commands.

The settings of all processes have the same defaults (a test compares them); loading those takes
longer than most commands do.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from buildarena_client.config import DEFAULT_URL, KEY_VARIABLE

DEFAULT_PORT: Final = 8321
DEFAULT_DATA: Final = ".buildarena"


def data_folder(chosen: Path | None) -> Path:
    """Return the data folder: the given one, or BUILDARENA_DATA, or the default."""
    return chosen or Path(os.environ.get("BUILDARENA_DATA") or DEFAULT_DATA)


__all__ = ["DEFAULT_DATA", "DEFAULT_PORT", "DEFAULT_URL", "KEY_VARIABLE", "data_folder"]
