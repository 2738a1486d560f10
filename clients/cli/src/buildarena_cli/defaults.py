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


def kept_key() -> str | None:
    """The API key of BUILDARENA_KEY, or of the file that BUILDARENA_KEY_FILE names; None for none.

    Raises:
        SecretFileError: Both are set, or the file can't be read.
    """
    if not os.environ.get(f"{KEY_VARIABLE}_FILE"):
        return os.environ.get(KEY_VARIABLE)
    from buildarena_pipeline.secret_files import read_secret

    return read_secret(KEY_VARIABLE, os.environ)
