"""Address of the service and API key, with checks of both."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from buildarena_client.errors import BadArgumentError

DEFAULT_URL: Final = "http://127.0.0.1:8321"
URL_VARIABLE: Final = "BUILDARENA_URL"
KEY_VARIABLE: Final = "BUILDARENA_KEY"
"""Environment variable of the API key, which others could read on a command line."""
MAX_KEY_BYTES: Final = 64 * 1024
"""Maximum size of a key file: a larger one was named by mistake."""


def checked_url(url: str | None) -> str:
    """Return the URL of an API without a final slash; None means BUILDARENA_URL or the default.

    Raises:
        BadArgumentError: It is invalid. The message omits a password in it.
    """
    url = url if url is not None else os.environ.get(URL_VARIABLE) or DEFAULT_URL
    if "@" in url:
        raise BadArgumentError("the URL of an API has no user or password in it: give the key")
    try:
        parts = urlsplit(url)
        host = (parts.hostname or "").encode("idna")
        is_url = parts.scheme in {"http", "https"} and host and parts.port != 0
    except ValueError as error:
        raise BadArgumentError(f"{url!r} is not the URL of an API: {error}") from error
    if not is_url or parts.query or parts.fragment or not url.isprintable() or " " in url:
        raise BadArgumentError(f"{url!r} is not the URL of an API, such as {DEFAULT_URL}")
    return url.rstrip("/")


def checked_key(key: str | None) -> str | None:
    """Check that a key can be sent, and return it; None for none.

    Raises:
        BadArgumentError: It cannot be sent; the message omits it.
    """
    if key and not (key.isascii() and key.isprintable()):
        raise BadArgumentError(f"{KEY_VARIABLE} is not a key: keys are printable ASCII")
    return key or None


def stored_key(environment: Mapping[str, str] | None = None) -> str | None:
    """Return the key of BUILDARENA_KEY or of the file named by BUILDARENA_KEY_FILE, or None.

    Empty variables count as not set. One final line end of a file is removed.

    Args:
        environment: Environment variables. Defaults to those of the process.

    Raises:
        BadArgumentError: Both are set, or the file can't be read or contains no key.
    """
    environment = os.environ if environment is None else environment
    variable = f"{KEY_VARIABLE}_FILE"
    direct, file = environment.get(KEY_VARIABLE), environment.get(variable)
    if direct and file:
        raise BadArgumentError(f"{KEY_VARIABLE} and {variable} are both set: leave one of them out")
    if not file:
        return direct or None
    try:
        with Path(file).open("rb") as opened:
            data = opened.read(MAX_KEY_BYTES + 1)
        secret = data.decode().removesuffix("\n").removesuffix("\r")
    except UnicodeDecodeError:
        raise BadArgumentError(f"{variable} names {file}, which is not UTF-8 text") from None
    except OSError as error:
        raise BadArgumentError(f"{variable} names {file}: {error.strerror}") from error
    if len(data) > MAX_KEY_BYTES:
        raise BadArgumentError(f"{variable} names {file}: more than {MAX_KEY_BYTES} bytes")
    if not secret.strip():
        raise BadArgumentError(f"{variable} names {file}, which is empty")
    return secret
