"""Secrets in files: `NAME_FILE` names the file of the variable `NAME`.

Compose and Kubernetes mount secrets as files, so that no environment has them
that can be looked at.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

SUFFIX: Final = "_FILE"
MAX_BYTES: Final = 64 * 1024
"""More than any key or URL has: a larger file was named by mistake."""


class SecretFileError(ValueError):
    """A secret can't be read; the message names the variable and never the file's content."""


def read_secret(name: str, environment: Mapping[str, str]) -> str | None:
    """Return a secret, from its variable or from the file that its `_FILE` variable names.

    Variables that are empty count as not set, as compose files spell those that are left out.

    Args:
        name: The variable, for example ``BUILDARENA_ADMIN_KEY``.
        environment: All variables.

    Returns:
        The secret without one line end at its end; None when neither variable is set.

    Raises:
        SecretFileError: Both are set, or the file is unreadable, empty or not a text.
    """
    direct, file = environment.get(name), environment.get(name + SUFFIX)
    if direct and file:
        raise SecretFileError(f"{name} and {name}{SUFFIX} are both set: leave one of them out")
    if file:
        return _read(name + SUFFIX, Path(file))
    return direct or None


def _read(variable: str, path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise SecretFileError(f"{variable} names {path}: {reason}") from error
    if len(data) > MAX_BYTES:
        raise SecretFileError(f"{variable} names {path}, which has more than {MAX_BYTES} bytes")
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        raise SecretFileError(f"{variable} names {path}, which is not UTF-8 text") from error
    secret = text.removesuffix("\n").removesuffix("\r")
    if not secret.strip():
        raise SecretFileError(f"{variable} names {path}, which is empty")
    return secret
