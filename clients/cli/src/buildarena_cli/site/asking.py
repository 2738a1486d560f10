"""Requests of pages, and their responses as a site stores them."""

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
    """Return the key by which pages look up a response: decoded, with sorted parameters."""
    pairs = sorted(
        f"{name}={value}"
        for name, param in (params or {}).items()
        for value in (
            param if isinstance(param, Sequence) and not isinstance(param, str) else [param]
        )
        if value is not None
    )
    return path + ("?" + "&".join(pairs) if pairs else "")


class TooLargeError(CommandError):
    """The service refused to send an answer because of its size."""


def ask(client: Client, path: str, *, accept: str | None = None, **params: Any) -> bytes | None:
    """Return the bytes of an answer; None if the resource does not exist.

    Waits while the service restarts.

    Raises:
        TooLargeError: The answer exceeds the service's limit.
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
