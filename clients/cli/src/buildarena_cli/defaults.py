"""Where commands look by default.

The settings of all processes have the same defaults (a test compares them); loading those takes
longer than most commands do.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

DEFAULT_PORT: Final = 8321
DEFAULT_URL: Final = f"http://127.0.0.1:{DEFAULT_PORT}"
DEFAULT_DATA: Final = ".buildarena"
KEY_VARIABLE: Final = "BUILDARENA_KEY"
"""The environment variable of the API key: on a command line, others could read it."""


def data_folder(given: Path | None) -> Path:
    """The data folder: the given one, or BUILDARENA_DATA, or the default."""
    return given or Path(os.environ.get("BUILDARENA_DATA") or DEFAULT_DATA)
