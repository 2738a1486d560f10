"""Questions that pages ask, and their answers as a site keeps them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from buildarena_cli.client import RESTART_S, Client, RefusedError, UnreachableError
from buildarena_cli.errors import CommandError
from buildarena_cli.site.folder import as_json

ABSENT: Final = 404
TOO_LARGE: Final = 413
PAUSE_S: Final = 0.5


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer.

    Attributes:
        content: Its bytes.
        ending: The ending of its file.
    """

    content: bytes
    ending: str = "json"


Answers = dict[str, Answer | None]
"""Answers by question; None where the service has none."""


def question(path: str, params: Mapping[str, Any] | None = None) -> str:
    """Path and parameters as pages look them up: decoded, the parameters in order."""
    words = sorted(
        f"{name}={value}"
        for name, param in (params or {}).items()
        for value in (
            param if isinstance(param, Sequence) and not isinstance(param, str) else [param]
        )
        if value is not None
    )
    return path + ("?" + "&".join(words) if words else "")


class TooLargeError(CommandError):
    """The service has an answer, but it is too large to be given."""


def ask(client: Client, path: str, *, accept: str | None = None, **params: Any) -> bytes | None:
    """Return the bytes of an answer; None when there is no such thing.

    Waits for a service that is being restarted.

    Raises:
        TooLargeError: The answer is larger than the service gives.
    """
    deadline = time.monotonic() + RESTART_S
    while True:
        try:
            return client.get_bytes(path, accept=accept, **params)
        except RefusedError as error:
            if error.status == ABSENT:
                return None
            if error.status == TOO_LARGE:
                raise TooLargeError(str(error)) from error
            raise
        except UnreachableError:
            if time.monotonic() > deadline:
                raise
            time.sleep(PAUSE_S)


def document(value: Any) -> Answer:
    """Return a JSON document as an answer."""
    return Answer(as_json(value))
